// Colours that people who do not tell red from green tell apart, on light and dark ground.

// 33 colours of matplotlib's cividis and viridis (public domain, CC0), six hexadecimal digits each.
const MAPS = {
  cividis: "00224e00285b002e6a0533711a386f273e6e32436d3b496c434e6c4b546c535a6d5a5f6e61656f686a716f70737676767d7c788482798c8878938e789b9476a39a74aba072b4a76fbcae6cc4b468cdbb63d5c25edec958e7d150f0d846f9e03afee838",
  viridis: "440154470d6048186a482374472d7b4537814240863e49893b528b375b8d33638d2f6b8e2c728e297a8e26828e23898e21918c1f988b1fa08822a78528ae8032b67a3fbc734ec36b5ec96270cf5784d44b98d83eaddc30c2df23d8e219ece51bfde725",
};

export const MAP_NAMES = Object.keys(MAPS);

/** The colours of a map as rows of red, green and blue from 0 to 1. */
export function colourMap(name) {
  const digits = MAPS[name] || MAPS.cividis;
  const rows = [];
  for (let at = 0; at < digits.length; at += 6) {
    rows.push([0, 2, 4].map((k) => parseInt(digits.slice(at + k, at + k + 2), 16) / 255));
  }
  return rows;
}

/** Red, green and blue of a part t from 0 to 1, written into out at a place. */
export function colourAt(map, t, out, place) {
  const x = Math.min(Math.max(t, 0), 1) * (map.length - 1);
  const low = Math.min(Math.floor(x), map.length - 2);
  const part = x - low;
  for (let k = 0; k < 3; k += 1) out[place + k] = map[low][k] + part * (map[low + 1][k] - map[low][k]);
}

export function cssColour(map, t) {
  const out = [0, 0, 0];
  colourAt(map, t, out, 0);
  return `rgb(${out.map((c) => Math.round(255 * c)).join(",")})`;
}

// Okabe and Ito's colours, and a form for each, by the label of a contact state.
const STATES = {
  open: ["#9a9a9a", "ring"],
  "contact, stick": ["#0072b2", "square"],
  "contact, slip": ["#e69f00", "triangle"],
  contact: ["#56b4e9", "disc"],
  "bonded": ["#009e73", "disc"],
  "bonded, stick": ["#009e73", "square"],
  "bonded, slip": ["#009e73", "triangle"],
  softening: ["#cc79a7", "disc"],
  "softening, stick": ["#cc79a7", "square"],
  "softening, slip": ["#cc79a7", "triangle"],
  debonded: ["#d55e00", "ring"],
};

export function stateMark(label) {
  const [colour, form] = STATES[label] || ["#9a9a9a", "disc"];
  return { colour, form };
}

