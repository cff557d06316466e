// The problem file as text: the one state of the page. Sliders write into it, undo and links restore it.

/** A text whose numbers are known by their keys and places. */
export class ProblemText {
  constructor(text = "") {
    this.text = text;
    this.spots = new Map();
  }

  /** Where numbers stand, as the server found them in this very text. */
  know(sliders) {
    this.spots = new Map(sliders.map((one) => [one.key, { start: one.start, end: one.end, value: one.value, whole: one.whole }]));
  }

  get numbers() {
    return new Map([...this.spots].map(([key, spot]) => [key, spot.value]));
  }

  /** Put a number in its place; all that stands behind it moves. */
  put(key, value) {
    const spot = this.spots.get(key);
    if (!spot) return false;
    const written = numeral(value, spot.whole);
    const shift = written.length - (spot.end - spot.start);
    this.text = this.text.slice(0, spot.start) + written + this.text.slice(spot.end);
    for (const other of this.spots.values()) {
      if (other.start > spot.start) {
        other.start += shift;
        other.end += shift;
      }
    }
    spot.end = spot.start + written.length;
    spot.value = value;
    return true;
  }

  /** The text with another character in the place of one number. */
  without(key) {
    const spot = this.spots.get(key);
    return spot ? `${this.text.slice(0, spot.start)}\u0000${this.text.slice(spot.end)}` : this.text;
  }

  /** The text with half as many cells. */
  coarser() {
    const copy = new ProblemText(this.text);
    copy.spots = new Map([...this.spots].map(([key, spot]) => [key, { ...spot }]));
    for (const [key, value] of copy.numbers) if (/^mesh\.(.+\.)?cells\./.test(key)) copy.put(key, Math.max(1, Math.round(value / 2)));
    return copy.text;
  }

  /** The line, from 0, on which a key stands; -1 if that is not known. */
  line(key) {
    const spot = this.spots.get(key);
    return spot ? this.text.slice(0, spot.start).split("\n").length - 1 : -1;
  }
}

function numeral(value, whole) {
  if (whole) return String(Math.round(value));
  const text = String(Number(value.toPrecision(12)));
  return /[.e]/.test(text) ? text : `${text}.0`;
}

/** Texts to go back to. */
export class Undo {
  constructor() {
    this.past = [];
    this.future = [];
  }

  /** Remember a text before it changes. */
  keep(text) {
    if (this.past[this.past.length - 1] === text) return;
    this.past.push(text);
    if (this.past.length > 200) this.past.shift();
    this.future = [];
  }

  back(text) {
    while (this.past.length && this.past[this.past.length - 1] === text) this.past.pop();
    if (!this.past.length) return null;
    this.future.push(text);
    return this.past.pop();
  }

  forth(text) {
    if (!this.future.length) return null;
    this.past.push(text);
    return this.future.pop();
  }
}

/** Text in few characters that an address may hold. */
export async function packed(text) {
  const bytes = new TextEncoder().encode(text);
  if (typeof CompressionStream === "undefined") return `t${base64(bytes)}`;
  return `d${base64(await through(bytes, new CompressionStream("deflate-raw")))}`;
}

/** What packed made; null if it is none. */
export async function unpackedText(short) {
  try {
    const binary = atob(short.slice(1).replaceAll("-", "+").replaceAll("_", "/"));
    const bytes = Uint8Array.from(binary, (c) => c.charCodeAt(0));
    if (short[0] === "t") return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
    if (short[0] !== "d") return null;
    return new TextDecoder("utf-8", { fatal: true }).decode(await through(bytes, new DecompressionStream("deflate-raw")));
  } catch {
    return null;
  }
}

async function through(bytes, stream) {
  return new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());
}

function base64(bytes) {
  let binary = "";
  for (const byte of bytes) binary += String.fromCharCode(byte);
  return btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}
