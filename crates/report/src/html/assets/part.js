// The part in 3-D: triangles from back to front on a plain canvas, coloured by deviation.
const data = JSON.parse(document.getElementById("data").textContent);
// One canvas for each map, all seen from the same direction.
const canvases = [...document.querySelectorAll("canvas.part")];
const bars = [...document.querySelectorAll("canvas.bars")];
if (canvases.length && data.points) {
  const { points, triangles, maps } = data;
  const count = points.length / 3;
  const limit = document.getElementById("limit");
  const there = document.getElementById("there");
  // The scale ignores a few extreme places, because all others would look pale.
  const sizes = maps.flatMap((map) => map.values.filter((v) => v !== null).map(Math.abs)).sort((a, b) => a - b);
  const most = sizes.length ? sizes[Math.floor(0.98 * (sizes.length - 1))] : 0;
  limit.value = Math.max(most / 1e4, 0.001).toPrecision(2);
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i++) {
    low[i % 3] = Math.min(low[i % 3], points[i]);
    high[i % 3] = Math.max(high[i % 3], points[i]);
  }
  const centre = low.map((v, k) => (v + high[k]) / 2);
  const size = Math.hypot(...high.map((v, k) => v - low[k])) || 1;
  const VIEWS = { iso: [-0.6, 0.9], top: [0, 0], front: [0, 1.57], side: [-1.57, 1.57] };
  const view = { turn: VIEWS.iso[0], tilt: VIEWS.iso[1], zoom: 1, x: 0, y: 0 };
  // The place of the largest deviation of each map.
  const worst = maps.map((map) => map.values.reduce((best, v, i) => (v !== null && (best < 0 || Math.abs(v) > Math.abs(map.values[best])) ? i : best), -1));
  const seen = new Float64Array(points.length);
  const order = Array.from({ length: triangles.length / 3 }, (_, i) => i);
  const depth = new Float64Array(order.length);
  const mix = (a, b, t) => a.map((v, k) => v + (b[k] - v) * t);
  const grey = [205, 205, 205], red = [200, 30, 30], blue = [30, 70, 200], uncut = [222, 205, 160];
  const css = (base, light) => `rgb(${base.map((v) => Math.round(v * light)).join(",")})`;
  const colour = (value, light) => {
    const share = value === null ? null : Math.min(1, Math.abs(value) / 1e4 / limit.value);
    return css(share === null ? uncut : mix(grey, value > 0 ? red : blue, share), light);
  };
  document.getElementById("ramp").style.background = `linear-gradient(to right, ${[blue, grey, red].map((v) => css(v, 1)).join(",")})`;
  document.getElementById("uncut").style.background = css(uncut, 1);
  const legend = () => {
    document.getElementById("low").textContent = `−${limit.value} mm gouged`;
    document.getElementById("high").textContent = `+${limit.value} mm left over`;
  };
  const draw = () => {
    legend();
    canvases.forEach(drawMap);
    bars.forEach(drawBars);
  };
  // Clears a canvas, scales it to the screen's pixels, and returns its context and size.
  const cleared = (canvas) => {
    const context = canvas.getContext("2d");
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const ratio = window.devicePixelRatio || 1;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    return [context, width, height];
  };
  const drawBars = (canvas, which) => {
    const [context, width, height] = cleared(canvas);
    const values = maps[which].values.filter((v) => v !== null).map((v) => v / 1e4);
    if (!values.length) return;
    const reach = 2 * limit.value;
    const BINS = 61;
    const counts = new Array(BINS).fill(0);
    // Values beyond the chart are counted in its outermost bars.
    values.forEach((v) => { counts[Math.min(BINS - 1, Math.max(0, Math.floor(((v + reach) / (2 * reach)) * BINS)))] += 1; });
    const most = Math.max(...counts);
    const [left, right, top, bottom] = [8, width - 8, 8, height - 24];
    const x = (v) => left + ((right - left) * (v + reach)) / (2 * reach);
    counts.forEach((count, k) => {
      const middle = -reach + ((k + 0.5) * 2 * reach) / BINS;
      context.fillStyle = colour(middle * 1e4, 1);
      const tall = ((bottom - top) * count) / most;
      context.fillRect(x(-reach + (k * 2 * reach) / BINS) + 0.5, bottom - tall, (right - left) / BINS - 1, tall);
    });
    context.strokeStyle = theme("--chosen");
    context.setLineDash([6, 4]);
    for (const v of [-limit.value, +limit.value]) {
      context.beginPath();
      context.moveTo(x(v), top);
      context.lineTo(x(v), bottom);
      context.stroke();
    }
    context.setLineDash([]);
    context.fillStyle = theme("--muted");
    context.font = `12px ${theme("--font")}`;
    context.textAlign = "center";
    for (const v of [-limit.value, 0, +limit.value]) context.fillText(`${v} mm`, x(v), height - 6);
    const within = values.filter((v) => Math.abs(v) <= limit.value).length / values.length;
    context.textAlign = "left";
    [`${(100 * within).toFixed(1)} %`, "within"].forEach((text, k) => context.fillText(text, left, top + 12 + 16 * k));
  };
  const drawMap = (canvas, which) => {
    const [context, width, height] = cleared(canvas);
    const scale = (0.9 * view.zoom * Math.min(width, height)) / size;
    const [ct, st, cl, sl] = [Math.cos(view.turn), Math.sin(view.turn), Math.cos(view.tilt), Math.sin(view.tilt)];
    for (let i = 0; i < count; i++) {
      const [x, y, z] = [0, 1, 2].map((k) => points[3 * i + k] - centre[k]);
      const [u, v] = [ct * x - st * y, st * x + ct * y];
      seen[3 * i] = width / 2 + view.x + scale * u;
      seen[3 * i + 1] = height / 2 + view.y - scale * (v * cl + z * sl);
      seen[3 * i + 2] = v * sl - z * cl;
    }
    for (let i = 0; i < order.length; i++) {
      depth[i] = seen[3 * triangles[3 * i] + 2] + seen[3 * triangles[3 * i + 1] + 2] + seen[3 * triangles[3 * i + 2] + 2];
    }
    order.sort((a, b) => depth[b] - depth[a]);
    const values = maps[which].values;
    for (const i of order) {
      const [a, b, c] = [triangles[3 * i], triangles[3 * i + 1], triangles[3 * i + 2]];
      const [x, y] = [seen[3 * a], seen[3 * a + 1]];
      const area = (seen[3 * b] - x) * (seen[3 * c + 1] - y) - (seen[3 * c] - x) * (seen[3 * b + 1] - y);
      // Triangles that are clockwise on the screen face away from the viewer.
      if (area >= 0) continue;
      const three = [values[a], values[b], values[c]].filter((v) => v !== null);
      const value = three.length ? three.reduce((sum, v) => sum + v, 0) / three.length : null;
      const [p, q] = [[0, 1, 2].map((k) => points[3 * b + k] - points[3 * a + k]), [0, 1, 2].map((k) => points[3 * c + k] - points[3 * a + k])];
      const n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
      const light = 0.7 + 0.3 * Math.abs((0.3 * n[0] + 0.2 * n[1] + 0.93 * n[2]) / (Math.hypot(...n) || 1));
      context.fillStyle = context.strokeStyle = colour(value, light);
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(seen[3 * b], seen[3 * b + 1]);
      context.lineTo(seen[3 * c], seen[3 * c + 1]);
      context.closePath();
      context.fill();
      context.stroke();
    }
    const axes = [[ct, st * cl], [-st, ct * cl], [0, sl]].map(([u, v]) => [u, -v]);
    drawTriad(context, height, axes);
    drawSizes(context, width);
    if (data.cutters[which]) drawCutter(context, data.cutters[which], (place) => {
      const [x, y, z] = place.map((v, k) => v - centre[k]);
      return [width / 2 + view.x + scale * (ct * x - st * y), height / 2 + view.y - scale * ((st * x + ct * y) * cl + z * sl)];
    });
    if (worst[which] >= 0) drawRing(context, seen[3 * worst[which]], seen[3 * worst[which] + 1]);
  };
  // The outline of a cutter: a convex body, so that the hull of some of its circles on the screen is its outline.
  const drawCutter = (context, { tip, axis, radius, corner }, onScreen) => {
    const side = Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const long = cross(axis, side);
    const across = long.map((v) => v / Math.hypot(...long));
    const along = cross(axis, across);
    // Height above the tip and radius of each circle: round the corner, then up to the end of the drawn part.
    const circles = [0, 0.25, 0.5, 0.75, 1].map((share) => {
      const angle = (share * Math.PI) / 2;
      return [corner * (1 - Math.cos(angle)), radius - corner * (1 - Math.sin(angle))];
    });
    circles.push([Math.max(5 * radius, corner), radius]);
    const spots = circles.flatMap(([up, wide]) => Array.from({ length: 32 }, (_, k) => {
      const [c, s] = [Math.cos((k * Math.PI) / 16), Math.sin((k * Math.PI) / 16)];
      return onScreen(tip.map((v, i) => v + up * axis[i] + wide * (c * across[i] + s * along[i])));
    }));
    context.beginPath();
    hull(spots).forEach(([x, y], k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
    context.fillStyle = context.strokeStyle = theme("--tool");
    context.globalAlpha = 0.25;
    context.fill();
    context.globalAlpha = 0.8;
    context.stroke();
    context.globalAlpha = 1;
  };
  // The convex hull of points on the screen, by the monotone chain.
  const hull = (spots) => {
    const sorted = [...spots].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (from) => {
      const out = [];
      for (const spot of from) {
        while (out.length > 1) {
          const [[ax, ay], [bx, by]] = out.slice(-2);
          if ((bx - ax) * (spot[1] - ay) - (by - ay) * (spot[0] - ax) > 0) break;
          out.pop();
        }
        out.push(spot);
      }
      return out.slice(0, -1);
    };
    return [...half(sorted), ...half([...sorted].reverse())];
  };
  const drawSizes = (context, width) => {
    const sizes = high.map((v, k) => `${["X", "Y", "Z"][k]} ${((v - low[k]) / 1e3).toFixed(1)}`);
    context.font = `12px ${theme("--font")}`;
    context.fillStyle = theme("--muted");
    context.textAlign = "right";
    context.fillText(`${sizes.join(" × ")} mm`, width - 10, 18);
    context.textAlign = "start";
  };
  const showDeviation = (which, i) => {
    const value = maps[which].values[i];
    const at = [0, 1, 2].map((k) => (points[3 * i + k] / 1e3).toFixed(2)).join(", ");
    there.textContent = `(${at}) mm: ${value === null ? "not cut" : `${(value / 1e4).toFixed(4)} mm`}`;
  };
  const fit = () => Object.assign(view, { zoom: 1, x: 0, y: 0 });
  let waits = false;
  const soon = () => {
    if (!waits) requestAnimationFrame(() => { waits = false; draw(); });
    waits = true;
  };
  let drag = null;
  canvases.forEach((canvas, which) => {
    canvas.addEventListener("pointerdown", (event) => { drag = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { drag = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!drag) return;
      const [dx, dy] = [event.clientX - drag[0], event.clientY - drag[1]];
      drag = [event.clientX, event.clientY];
      if (event.shiftKey) { view.x += dx; view.y += dy; } else { view.turn += 0.008 * dx; view.tilt = Math.min(1.57, Math.max(-1.57, view.tilt + 0.008 * dy)); }
      soon();
    });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); view.zoom *= Math.exp(-0.001 * event.deltaY); soon(); }, { passive: false });
    canvas.addEventListener("click", (event) => {
      const box = canvas.getBoundingClientRect();
      let best = null;
      for (let i = 0; i < count; i++) {
        const far = Math.hypot(seen[3 * i] - event.clientX + box.left, seen[3 * i + 1] - event.clientY + box.top);
        if (far < 8 && (best === null || seen[3 * i + 2] < seen[3 * best + 2])) best = i;
      }
      if (best !== null) showDeviation(which, best);
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      const zoom = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
      if (step) {
        view.turn += step[0];
        view.tilt = Math.min(1.57, Math.max(-1.57, view.tilt + step[1]));
      } else if (zoom) view.zoom *= zoom;
      else if (event.key === "0") fit();
      else return;
      event.preventDefault();
      soon();
    });
  });
  // For tests that drive the page from outside.
  window.deflex = { view, worst, maps };
  limit.addEventListener("input", soon);
  document.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => {
    fit();
    if (button.dataset.view in VIEWS) [view.turn, view.tilt] = VIEWS[button.dataset.view];
    soon();
  }));
  // The last map is the result: that of the corrected program, if there are two.
  document.getElementById("worst").addEventListener("click", () => {
    const which = maps.length - 1;
    if (worst[which] < 0) return;
    showDeviation(which, worst[which]);
    const canvas = canvases[which];
    view.x += canvas.clientWidth / 2 - seen[3 * worst[which]];
    view.y += canvas.clientHeight / 2 - seen[3 * worst[which] + 1];
    soon();
  });
  window.addEventListener("resize", soon);
  draw();
}
