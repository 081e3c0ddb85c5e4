// Ticks with enough decimals to distinguish them, also for micrometres on a scale in millimetres.
const tickLabels = (ticks, step) => {
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  return ticks.map((tick) => {
    if (decimals > 6) return Math.abs(tick) < step / 2 ? "0" : tick.toExponential(1);
    return tick.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1");
  });
};

// Charts along the path, one below the other, with a common cursor and a common zoom (uPlot).

class Charts {
  // `choose` receives the index of a clicked point.
  constructor(root, choose) {
    this.root = root;
    this.choose = choose;
    this.plots = [];
    this.marked = -1;
    new ResizeObserver(() => this.resize()).observe(root);
  }

  // panels: [{ heading, title, unit, digits, limit, range, series: [{ label, values, style }] }] over common x values.
  // A panel with a heading starts a group, and shows the key of that group. A limit is a line across the chart. A range
  // is shown whatever the values are. `span` is the range of x that is shown at first, if it differs from that of the
  // values.
  show(x, xLabel, panels, points, span) {
    this.plots.forEach((plot) => plot.destroy());
    this.root.replaceChildren();
    this.x = x;
    this.scale = null;
    this.plots = panels.map((panel, i) => this.plot(panel, x, xLabel, i === panels.length - 1, points));
    if (span) this.plots[0]?.setScale("x", { min: span[0], max: span[1] });
  }

  plot(panel, x, xLabel, last, points) {
    if (panel.heading) {
      const form = points ? { before: " ring", after: " dot" } : {};
      const entry = ({ style, label }) => element("span", { className: `swatch ${style}${form[style] ?? ""}`, textContent: label });
      const limit = panel.limit ? [{ style: "limit", label: `tolerance ${panel.limit} ${panel.unit}` }] : [];
      const key = element("p", { className: "key" }, ...[...panel.series, ...limit].map(entry));
      this.root.append(element("div", { className: "heading" }, element("h2", { textContent: panel.heading }), key));
    }
    const host = element("div", { className: "plot" });
    this.root.append(host);
    const axis = {
      stroke: theme("--muted"),
      font: `12px ${theme("--font")}`,
      grid: { stroke: theme("--grid"), width: 1 },
      ticks: { stroke: theme("--grid"), width: 1, size: 4 },
    };
    const series = panel.series.map(({ label, style }) => ({
      label,
      stroke: theme(`--${style}`),
      width: points ? 0 : style === "before" ? 1.25 : 1.75,
      dash: style === "before" && panel.series.length > 1 && x.length <= 400 ? [5, 3] : undefined,
      paths: points ? () => null : undefined,
      points: points ? { show: true, size: style === "before" ? 5 : 4, width: 1.25, stroke: theme(`--${style}`), fill: style === "before" ? "transparent" : theme(`--${style}`) } : { show: x.length === 1 },
      value: (_, value) => (value == null ? "" : value.toFixed(panel.digits)),
    }));
    const mark = (plot) => {
      if (this.marked < 0) return;
      const at = Math.round(plot.valToPos(this.x[this.marked], "x", true));
      const { left, top, width, height } = plot.bbox;
      if (at < left || at > left + width) return;
      plot.ctx.save();
      plot.ctx.fillStyle = theme("--chosen");
      plot.ctx.fillRect(at, top, Math.max(1, uPlot.pxRatio), height);
      plot.ctx.restore();
    };
    const drawLimit = (plot) => {
      if (!panel.limit) return;
      const at = Math.round(plot.valToPos(panel.limit, "y", true));
      const { left, width } = plot.bbox;
      plot.ctx.save();
      plot.ctx.strokeStyle = theme("--chosen");
      plot.ctx.lineWidth = uPlot.pxRatio;
      plot.ctx.setLineDash([6 * uPlot.pxRatio, 4 * uPlot.pxRatio]);
      plot.ctx.beginPath();
      plot.ctx.moveTo(left, at);
      plot.ctx.lineTo(left + width, at);
      plot.ctx.stroke();
      plot.ctx.restore();
    };
    // The tolerance and zero are always visible.
    const limited = (_, low, high) => [Math.min(0, low), 1.08 * Math.max(panel.limit, high)];
    const fixed = () => uPlot.rangeNum(...panel.range, 0.1, true);
    const range = panel.limit ? { range: limited } : panel.range?.every(Number.isFinite) ? { range: fixed } : {};
    const options = {
      width: Math.max(280, this.root.clientWidth),
      height: last ? 172 : 128,
      padding: [12, 8, 0, 0],
      scales: { x: { time: false }, y: range },
      cursor: {
        sync: { key: "path" },
        drag: { x: true, y: false },
        points: { size: 7 },
      },
      legend: { live: true },
      axes: [
        { ...axis, label: last ? xLabel : undefined, labelSize: 20, labelFont: axis.font, size: last ? 30 : 6, values: (_, ticks) => ticks.map((tick) => (last && Number.isInteger(tick) ? grouped(tick) : "")) },
        { ...axis, label: `${panel.title}, ${panel.unit}`, labelSize: 20, labelFont: `600 12px ${theme("--font")}`, size: 62, space: 24, values: (_, ticks, axis, space, step) => tickLabels(ticks, step) },
      ],
      series: [{ label: xLabel, value: (_, value) => (value == null ? "" : grouped(value)) }, ...series],
      hooks: {
        draw: [mark, drawLimit],
        setScale: [(plot, key) => key === "x" && this.follow(plot)],
        ready: [(plot) => plot.over.addEventListener("click", () => {
          const i = plot.cursor.idx;
          if (this.choose && i != null) this.choose(i);
        })],
      },
    };
    const data = [x, ...panel.series.map(({ values }) => values.map((value) => (Number.isNaN(value) ? null : value)))];
    return new uPlot(options, data, host);
  }

  // Sets the zoom of all charts to that of one.
  follow(from) {
    if (this.following) return;
    this.following = true;
    const { min, max } = from.scales.x;
    this.plots.filter((plot) => plot !== from).forEach((plot) => plot.setScale("x", { min, max }));
    this.following = false;
  }

  mark(i) {
    this.marked = i;
    this.plots.forEach((plot) => plot.redraw(false, false));
  }

  resize() {
    const width = Math.max(280, this.root.clientWidth);
    this.plots.filter((plot) => plot.width !== width).forEach((plot) => plot.setSize({ width, height: plot.height }));
  }
}
