// Elements, numbers as text, and bytes: what all parts of the page need.

const SVG = "http://www.w3.org/2000/svg";

/** An element with attributes, listeners (on...) and children. */
export function h(tag, attributes = {}, ...children) {
  return dressed(document.createElement(tag), attributes, children);
}

/** The same for a drawing. */
export function s(tag, attributes = {}, ...children) {
  return dressed(document.createElementNS(SVG, tag), attributes, children);
}

function dressed(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && typeof value !== "string" && !element.namespaceURI.endsWith("svg")) element[name] = value;
    else if (value !== undefined && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== undefined && child !== null));
  return element;
}

/** A number as people write it: four digits, a power of ten where it is far from 1. */
export function shown(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    return `${Number(mantissa)}·10${raised(Number(power))}`;
  }
  return String(Number(value.toPrecision(digits)));
}

function raised(power) {
  return [...String(power)].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] || "⁻").join("");
}

/** Round places for an axis from low to high, about so many. */
export function ticks(low, high, count) {
  const span = high - low;
  if (!(span > 0) || !Number.isFinite(span)) return [low];
  const power = 10 ** Math.floor(Math.log10(span / count));
  const step = [1, 2, 5, 10].map((d) => d * power).find((d) => span / d <= count + 1) || 10 * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k += 1) found.push(k * step);
  return found;
}

const TYPES = { "<f4": Float32Array, "<u4": Uint32Array };

/** The arrays of a message, from a head that lists them and buffers in the same order. */
export function arraysOf(head, buffers) {
  const found = {};
  head.arrays.forEach((entry, k) => {
    const view = buffers[k];
    const bytes = view instanceof ArrayBuffer ? view : view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength);
    found[entry.name] = new TYPES[entry.type](bytes);
    found[entry.name].columns = entry.shape[1] || 1;
  });
  return found;
}

/** A message of one run of bytes, see binary_message.py. */
export function unpacked(bytes) {
  const length = new DataView(bytes).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  let at = 4 + length;
  const buffers = head.arrays.map((entry) => {
    const size = 4 * entry.shape.reduce((a, b) => a * b, 1);
    at += size;
    return bytes.slice(at - size, at);
  });
  return { head, arrays: arraysOf(head, buffers) };
}

/** Hand a file to the browser's downloads. */
export function download(name, blob) {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** A name with its unit, where one is known. */
export function withUnit(name, unit) {
  return unit ? `${name} in ${unit}` : name;
}
