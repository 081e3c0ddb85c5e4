// Plays a program: moves a place along it, or takes the place from the slider.

// A turn of an axis by one degree takes as long as a millimetre of path, so that turns on the spot are visible.
const MM_PER_DEGREE = 1;
// If the user prefers reduced motion, the arm jumps from target to target, and each is shown for this time, ms.
const STILL = 500;

class Player {
  // `move` receives each place between targets, `rest` the target at which the player stops.
  constructor(root, { move, rest }) {
    this.on = { move, rest };
    this.root = root;
    [this.button, this.slider, this.pace] = ["play", "along", "pace"].map(byId);
    this.button.addEventListener("click", () => (this.isPlaying ? this.stop() : this.start()));
    this.slider.addEventListener("input", () => this.jump(Number(this.slider.value)));
    this.reduced = matchMedia("(prefers-reduced-motion: reduce)");
  }

  // The path to play. Without postures of the arm there is nothing to play.
  setPath(path) {
    this.path = path;
    this.root.hidden = path.length < 2 || !page.scene || !path.has(AXES[0]);
    if (this.root.hidden) return;
    this.slider.max = path.length - 1;
    // The time at which each target is reached, as a share of the whole time.
    const columns = [...POSITION.map((key) => [key, 0]), ...AXES.map((key) => [key, 1])].map(([key, turn]) => [path.column(key), turn]);
    const times = [0];
    for (let i = 1; i < path.length; i++) {
      const [way, turn] = [[], []];
      for (const [column, isTurn] of columns) (isTurn ? turn : way).push(Math.abs(column.at(i) - column.at(i - 1)) || 0);
      // If the arm cannot be interpolated, the step takes no time.
      const isSeen = followed(path, i - 0.5) === i - 0.5;
      times.push(times[i - 1] + (isSeen ? Math.hypot(...way) + MM_PER_DEGREE * Math.max(...turn) : 0));
    }
    this.times = times.map((time) => time / (times.at(-1) || 1));
  }

  // Moves to a target that was chosen elsewhere on the page.
  follow(i) {
    if (this.root.hidden) return;
    this.place = i;
    this.showState();
  }

  showState() {
    const i = Math.round(this.place);
    this.slider.value = i;
    this.slider.setAttribute("aria-valuetext", `target ${this.path.column("target").raw[i]} of ${this.path.count}`);
    const text = this.isPlaying ? "Pause" : "Play";
    if (this.button.textContent === text) return;
    this.button.textContent = text;
    // Screen readers must not read figures that change all the time.
    document.querySelector(".panel").setAttribute("aria-live", this.isPlaying ? "off" : "polite");
  }

  jump(i) {
    this.stop();
    this.on.rest(i);
  }

  start() {
    if (this.place >= this.path.length - 1) this.place = 0;
    this.isPlaying = true;
    this.before = null;
    this.frame = requestAnimationFrame((now) => this.step(now));
    this.showState();
  }

  stop() {
    if (!this.isPlaying) return;
    this.isPlaying = false;
    cancelAnimationFrame(this.frame);
    this.showState();
    this.on.rest(Math.round(this.place));
  }

  step(now) {
    // The time stamps of frames have an arbitrary zero, so they are counted from the first frame.
    const passed = now - (this.before ??= now);
    this.frame = requestAnimationFrame((next) => this.step(next));
    if (this.reduced.matches && passed < STILL) return;
    this.before = now;
    const place = this.placeAt(this.timeAt(this.place) + passed / 1000 / Number(this.pace.value));
    // Moves in steps of at least one target.
    this.place = this.reduced.matches ? Math.min(this.path.length - 1, Math.max(Math.floor(this.place) + 1, Math.round(place))) : place;
    if (this.place >= this.path.length - 1) return this.stop();
    this.showState();
    this.on.move(this.place);
  }

  timeAt(place) {
    const i = Math.floor(place);
    return i === place ? this.times[i] : this.times[i] + (place - i) * (this.times[i + 1] - this.times[i]);
  }

  placeAt(time) {
    let [low, high] = [0, this.times.length - 1];
    if (time >= 1) return high;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= time) low = middle;
      else high = middle;
    }
    return low + Math.min(1, (time - this.times[low]) / (this.times[high] - this.times[low] || 1));
  }
}
