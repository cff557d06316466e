// Pictures of what is shown, with title, scale and certificate: an SVG, and the same as PNG.

import { colourMap, cssColour, stateMark } from "./colours.js";
import { h, s, shown } from "./dom.js";
import { drawnMark } from "./plot.js";

const ROOM = { top: 34, bottom: 62 };

/** The picture with { title, foot, label, range, map, states }. */
export function svgOf(view, told, width = 900, height = 620) {
  const inner = height - ROOM.top - ROOM.bottom;
  const font = { "font-family": "sans-serif", fill: "#202124" };
  const root = s("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${width} ${height}`, width, height });
  root.append(s("rect", { width, height, fill: "#ffffff" }));
  root.append(s("text", { x: 16, y: 22, "font-size": 15, ...font }, told.title));
  root.append(s("g", { transform: `translate(0 ${ROOM.top})` }, ...view.drawing(width, inner)));
  const map = colourMap(told.map);
  const wide = 240;
  if (told.range) {
    for (let k = 0; k < 60; k += 1) {
      root.append(s("rect", { x: 16 + (k * wide) / 60, y: height - 46, width: wide / 60 + 0.5, height: 10, fill: cssColour(map, (k + 0.5) / 60) }));
    }
    root.append(s("text", { x: 16, y: height - 24, "font-size": 11, ...font }, shown(told.range[0], 3)));
    root.append(s("text", { x: 16 + wide, y: height - 24, "font-size": 11, "text-anchor": "end", ...font }, shown(told.range[1], 3)));
    root.append(s("text", { x: 16 + wide / 2, y: height - 24, "font-size": 11, "text-anchor": "middle", ...font }, told.label));
  }
  let x = 290;
  for (const label of told.states) {
    const { colour, form } = stateMark(label);
    root.append(drawnMark(form, x, height - 41, 4, colour), s("text", { x: x + 9, y: height - 37, "font-size": 11, ...font }, label));
    x += 24 + 6.5 * label.length;
  }
  root.append(s("text", { x: 290, y: height - 20, "font-size": 11, ...font }, told.foot));
  return root;
}

export function svgBlob(view, told) {
  const text = new XMLSerializer().serializeToString(svgOf(view, told));
  return new Blob([text], { type: "image/svg+xml" });
}

/** The SVG as a picture of twice its size. */
export async function pngBlob(view, told) {
  const picture = new Image();
  const address = URL.createObjectURL(svgBlob(view, told));
  try {
    picture.src = address;
    await picture.decode();
  } finally {
    URL.revokeObjectURL(address);
  }
  const canvas = h("canvas", { width: 2 * picture.width, height: 2 * picture.height });
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}
