// Rounded surfaces of coarse bodies. Part of one script with the other viewer files.
"use strict";

const COARSE = 3000; // vertices; finer bodies are drawn as they are
const ROUNDS = 2; // each divides every triangle into four

// A finer surface through the vertices of another one, which bulges as its normals say: the middle
// of an edge is on the cubic curve that leaves both ends at right angles to their normals. It is
// only drawn; triangles, values and files stay those of the body.
class SmoothSurface {
  constructor(geometry) {
    this.coarse = geometry;
    this.edges = []; // ends of the edges of each round, whose middles are the next vertices
    this.faces = geometry.index.array;
    let count = geometry.attributes.position.count;
    for (let round = 0; round < ROUNDS; round += 1) {
      const { ends, faces } = divided(this.faces, count);
      this.edges.push(ends);
      this.faces = faces;
      count += ends.length / 2;
    }
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setIndex(new THREE.BufferAttribute(this.faces, 1));
    this.count = count;
  }

  // The triangle of the body that a triangle of this surface lies on.
  faceOf(index) {
    return Math.floor(index / 4 ** ROUNDS);
  }

  // Follow the body, or only its colours.
  show() {
    const positions = this.copied("position");
    const normals = this.copied("normal");
    this.eachMiddle((a, b, middle) => {
      let alongA = 0;
      let alongB = 0;
      for (let k = 0; k < 3; k += 1) {
        const step = positions[b + k] - positions[a + k];
        alongA += step * normals[a + k];
        alongB += step * normals[b + k];
      }
      let length = 0;
      for (let k = 0; k < 3; k += 1) {
        positions[middle + k] = (positions[a + k] + positions[b + k]) / 2
          + (alongB * normals[b + k] - alongA * normals[a + k]) / 8;
        normals[middle + k] = normals[a + k] + normals[b + k];
        length += normals[middle + k] ** 2;
      }
      for (let k = 0; k < 3; k += 1) normals[middle + k] /= Math.sqrt(length) || 1;
    });
    this.paint();
  }

  paint() {
    ["color", "value"].filter((name) => this.coarse.attributes[name]).forEach((name) => {
      const values = this.copied(name);
      const size = this.coarse.attributes[name].itemSize;
      this.eachMiddle((a, b, middle) => {
        for (let k = 0; k < size; k += 1) {
          values[(middle / 3) * size + k] = (values[(a / 3) * size + k] + values[(b / 3) * size + k]) / 2;
        }
      });
    });
  }

  // The array of an attribute, with the body's values first.
  copied(name) {
    const { array, itemSize } = this.coarse.attributes[name];
    if (!this.geometry.attributes[name]) {
      const values = new Float32Array(itemSize * this.count);
      this.geometry.setAttribute(name, new THREE.BufferAttribute(values, itemSize));
    }
    const attribute = this.geometry.attributes[name];
    attribute.array.set(array);
    attribute.needsUpdate = true;
    return attribute.array;
  }

  // Call with the places of both ends and of the middle of each edge, round after round.
  eachMiddle(call) {
    let middle = 3 * this.coarse.attributes.position.count;
    this.edges.forEach((ends) => {
      for (let i = 0; i < ends.length; i += 2, middle += 3) call(3 * ends[i], 3 * ends[i + 1], middle);
    });
  }
}

// The edges of triangles, and the four triangles that each one becomes.
function divided(faces, count) {
  const ends = [];
  const numbers = new Map();
  const middleOf = (a, b) => {
    const key = Math.min(a, b) * count + Math.max(a, b);
    if (!numbers.has(key)) {
      numbers.set(key, count + ends.length / 2);
      ends.push(a, b);
    }
    return numbers.get(key);
  };
  const finer = new Uint32Array(4 * faces.length);
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = faces.slice(i, i + 3);
    const [ab, bc, ca] = [middleOf(a, b), middleOf(b, c), middleOf(c, a)];
    finer.set([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], 4 * i);
  }
  return { ends: Uint32Array.from(ends), faces: finer };
}
