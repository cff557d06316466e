// Pictures of what is shown: PNG as the screen has it, SVG for print, both with title, scale and certificate.

import { colourMap, cssColour, stateMark } from "./colours.js";
import { h, s, shown } from "./dom.js";
import { drawnMark } from "./plot.js";

const ROOM = { top: 34, bottom: 62 };

/** The parts that PNG and SVG share: { title, foot, label, range, map, states }. */
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

/** The canvas as it is, with title, scale and certificate written around it. */
export function pngBlob(view, told) {
  view.render();
  const source = view.canvas;
  const ratio = source.width / source.clientWidth || 1;
  const canvas = h("canvas", { width: source.width, height: source.height + Math.round((ROOM.top + ROOM.bottom) * ratio) });
  const pen = canvas.getContext("2d");
  const dark = view.dark();
  pen.fillStyle = dark ? "#1f2226" : "#ffffff";
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(source, 0, Math.round(ROOM.top * ratio));
  pen.scale(ratio, ratio);
  pen.fillStyle = dark ? "#e8eaed" : "#202124";
  pen.font = "15px sans-serif";
  pen.fillText(told.title, 16, 22);
  const bottom = canvas.height / ratio;
  const map = colourMap(told.map);
  pen.font = "11px sans-serif";
  if (told.range) {
    pen.fillText(`${shown(told.range[0], 3)}  ${told.label}  ${shown(told.range[1], 3)}`, 16, bottom - 24);
    for (let k = 0; k < 240; k += 1) {
      pen.fillStyle = cssColour(map, k / 239);
      pen.fillRect(16 + k, bottom - 50, 1.5, 10);
    }
    pen.fillStyle = dark ? "#e8eaed" : "#202124";
  }
  pen.fillText(told.states.join(" · "), 290, bottom - 41);
  pen.fillText(told.foot, 290, bottom - 24);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}
