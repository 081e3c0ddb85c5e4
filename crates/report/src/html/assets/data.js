// Numbers of the page: 32-bit integers in base64, or a single value for all, each divided by a power of ten, so that
// they print as in the CSV report.

const ABSENT = -(2 ** 31);

class Column {
  constructor({ decimals, data, all }, length) {
    this.decimals = decimals;
    if (data === undefined) {
      this.raw = new Int32Array(length).fill(all);
      return;
    }
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    this.raw = Int32Array.from({ length: bytes.length / 4 }, (_, i) => view.getInt32(4 * i, true));
  }

  has(i) {
    return this.raw[i] !== ABSENT;
  }

  // The value as a number, NaN if it is absent.
  at(i) {
    return this.has(i) ? this.raw[i] / 10 ** this.decimals : NaN;
  }

  // The value at a place between two targets, interpolated; NaN if one of the two is absent.
  between(place) {
    const i = Math.floor(place);
    return i === place ? this.at(i) : this.at(i) + (place - i) * (this.at(i + 1) - this.at(i));
  }

  // The value as the CSV prints it.
  text(i) {
    return this.has(i) ? this.at(i).toFixed(this.decimals).replace(/^-(0\.?0*)$/, "$1") : "";
  }

  isConstant() {
    return this.raw.every((value) => value === this.raw[0]);
  }

  numbers() {
    return Array.from(this.raw, (_, i) => this.at(i));
  }
}

class Path {
  constructor(json) {
    Object.assign(this, json);
    this.columns = Object.fromEntries(Object.entries(json.columns).map(([key, column]) => [key, new Column(column, json.kept)]));
    this.length = this.kept;
  }

  has(key) {
    return key in this.columns;
  }

  column(key) {
    return this.columns[key];
  }

  status(i) {
    return this.statuses[this.columns.status.raw[i]];
  }

  name(i) {
    return this.names[this.columns.name.raw[i]];
  }

  // Tool and work object, as the program names them.
  frames(i) {
    return this.columns.frames ? this.frame_names[this.columns.frames.raw[i]] : "";
  }

  // The line of the program, if the page quotes it.
  quote(i) {
    return this.columns.quote ? this.quotes[this.columns.quote.raw[i]] : "";
  }

  // Index of a target, or of the nearest target that the page has.
  find(target) {
    const all = this.columns.target.raw;
    let [low, high] = [0, all.length - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (all[middle] < target) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

const byId = (id) => document.getElementById(id);

const element = (name, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
};

// Colours of the style sheet, which differ for light, dark and print.
const theme = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const grouped = (count) => count.toLocaleString("en");
