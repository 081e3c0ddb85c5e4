// Two pages that a window shows side by side. Each sends its ranges and its view to the other through the window, so
// that both have the same axes, colours and view.

const wider = ([a, b], [c, d]) => [Math.min(a, c), Math.max(b, d)];
const NONE = [Infinity, -Infinity];
const rangeOf = (values, counts = () => true) =>
  values.reduce((range, value, i) => (Number.isNaN(value) || !counts(i) ? range : wider(range, [value, value])), NONE);

// The ranges of all columns of numbers, over all targets and over those that cut, and the box of the picture.
const rangesOf = (path, box) => {
  const cuts = (i) => path.status(i) !== "air";
  const keys = Object.keys(path.columns).filter((key) => !WORDS.includes(key));
  return { box, columns: keys.map((key) => [key, rangeOf(numbers(path, key)), rangeOf(numbers(path, key), cuts)]) };
};

const isNumbers = (list, length) => Array.isArray(list) && list.length === length && list.every(Number.isFinite);
const isBox = (box) => Array.isArray(box) && box.length === 3 && box.every((range) => isNumbers(range, 2));
const isLook = (look) => ["azimuth", "elevation", "zoom", "target"].every((key) => Number.isFinite(look?.[key])) && isNumbers(look.pan, 2) && isBox(look.box);

class Twin {
  // `own` returns the view of this page, `follow` takes the view of the other page, and `widen` is called when the
  // ranges of the other page arrive.
  constructor({ ranges, own, follow, widen }) {
    this.on = { ranges, own, follow, widen };
    this.columns = new Map();
    addEventListener("message", ({ source, data }) => source === parent && data?.twin && this.hear(data.twin));
  }

  // The range of a column on both pages.
  span(key, own, isOfCuts = false) {
    const other = this.columns.get(key)?.[isOfCuts ? 1 : 0];
    return other ? wider(own, other) : own;
  }

  box(own) {
    return this.otherBox ? own.map((range, axis) => wider(range, this.otherBox[axis])) : own;
  }

  // Sends the ranges of a new path. A page that receives ranges answers with its own.
  open() {
    this.send({ ranges: this.on.ranges(), isAnswer: false });
  }

  send(twin) {
    if (parent !== window) parent.postMessage({ twin }, "*");
  }

  hear({ ranges, isAnswer, look }) {
    if (ranges && isBox(ranges.box) && Array.isArray(ranges.columns)) {
      // The range of an empty column has no numbers.
      this.columns = new Map(ranges.columns.filter(([, all, cuts]) => isNumbers(all, 2) && isNumbers(cuts, 2)).map(([key, ...both]) => [key, both]));
      this.otherBox = ranges.box;
      this.on.widen();
      if (!isAnswer) this.send({ ranges: this.on.ranges(), isAnswer: true });
    }
    if (isLook(look)) this.follow(look);
  }

  follow(look) {
    this.isFollowing = true;
    this.on.follow(look);
    this.isFollowing = false;
    this.last = JSON.stringify(this.on.own());
  }

  // Sends the view of this page, if it has changed.
  sendView() {
    if (!this.otherBox || this.isFollowing) return;
    const look = this.on.own();
    const text = JSON.stringify(look);
    if (text === this.last) return;
    this.last = text;
    this.send({ look });
  }
}
