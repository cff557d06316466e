// Edges of a surface of triangles, as pairs of its points.

import * as THREE from "./vendor/three.module.min.js";

/** Every edge of the triangles once. */
export function edgesOf(triangles) {
  const seen = new Set();
  const out = [];
  for (let k = 0; k < triangles.length; k += 3) {
    for (let i = 0; i < 3; i += 1) {
      const a = triangles[k + i];
      const b = triangles[k + ((i + 1) % 3)];
      const key = Math.min(a, b) * 4294967296 + Math.max(a, b);
      if (seen.has(key)) continue;
      seen.add(key);
      out.push(a, b);
    }
  }
  return new Uint32Array(out);
}

/** The edges of a surface that are sharp or free, as pairs of its points. */
export function sharpEdges(triangles, points) {
  const sides = new Map();
  for (let k = 0; k < triangles.length; k += 3) {
    const [p, q, r] = [0, 1, 2].map((i) => new THREE.Vector3(...points.subarray(3 * triangles[k + i], 3 * triangles[k + i] + 3)));
    const normal = q.sub(p).cross(r.sub(p)).normalize();
    for (let i = 0; i < 3; i += 1) {
      const [a, b] = [triangles[k + i], triangles[k + ((i + 1) % 3)]];
      const key = Math.min(a, b) * 4294967296 + Math.max(a, b);
      if (!sides.has(key)) sides.set(key, { a, b, normals: [] });
      sides.get(key).normals.push(normal);
    }
  }
  const sharp = [...sides.values()].filter(({ normals }) => normals.length !== 2 || Math.abs(normals[0].dot(normals[1])) < 0.9);
  return new Uint32Array(sharp.flatMap(({ a, b }) => [a, b]));
}
