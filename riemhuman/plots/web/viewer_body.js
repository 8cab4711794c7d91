// One body of a viewer. Part of one script with viewer_gestures.js and viewer.js.
"use strict";

// Bytes of compressed data.
async function inflate(text) {
  const packed = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Rows of whole numbers from differences of rows, whose bytes of one significance stand together.
async function unpack(text, Kind, width) {
  const planes = await inflate(text);
  const numbers = new Kind(planes.length / Kind.BYTES_PER_ELEMENT);
  for (let i = 0; i < numbers.length; i += 1) {
    let value = 0;
    for (let plane = 0; plane < Kind.BYTES_PER_ELEMENT; plane += 1) {
      value += planes[plane * numbers.length + i] * 256 ** plane;
    }
    numbers[i] = i < width ? value : value + numbers[i - width];
  }
  return numbers;
}

// Part of the light that a channel of a colour means.
const linear = (value) =>
  value > 10 ? Math.pow((value / 255 + 0.055) / 1.055, 2.4) : value / 255 / 12.92;

// Vertices of one body at all times, and its surface in the scene.
class Body {
  static async from(data, faces, nVertices) {
    const [packed, values, colors, components] = await Promise.all([
      unpack(data.frames, Uint16Array, data.n_frames > 1 ? 3 * nVertices : 3),
      data.values && inflate(data.values),
      data.colors && inflate(data.colors),
      unpackComponents(data.components),
    ]);
    const numbers = values && new Float32Array(values.buffer);
    return new Body(data, faces, nVertices, { packed, values: numbers, colors, components });
  }

  constructor(data, faces, nVertices, { packed, values, colors, components }) {
    this.label = data.label;
    this.nFrames = data.n_frames;
    this.size = 3 * nVertices;
    this.packed = packed;
    this.components = components;
    this.lift = 0; // so that a body that components change stands on the ground
    this.low = data.low;
    this.step = data.step;
    this.values = values;
    // Otherwise each triangle has a value.
    this.hasVertexValues = Boolean(values) && values.length !== faces.length / 3;
    this.largest = data.largest;
    this.signed = Boolean(data.signed);
    this.scale = data.scale;
    this.valueLabel = data.value_label;
    this.geometry = new THREE.BufferGeometry();
    this.positions = new Float32Array(this.size);
    this.geometry.setAttribute("position", new THREE.BufferAttribute(this.positions, 3));
    this.geometry.setIndex(new THREE.BufferAttribute(faces, 1));
    const material = new THREE.MeshStandardMaterial({ roughness: LIGHT.roughness, metalness: 0 });
    if (colors) {
      this.geometry.setAttribute("color", new THREE.BufferAttribute(Float32Array.from(colors, linear), 3));
      material.vertexColors = true;
    } else {
      material.color = new THREE.Color(data.color);
    }
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.turning = new THREE.Group();
    this.turning.add(this.mesh);
    this.holder = new THREE.Group();
    this.holder.add(this.turning);
    this.pivot = null;
    this.measure();
    this.show(0);
    this.ground = new Ground(this, faces);
    this.mesh.add(this.ground.disc);
    this.show(0);
  }

  // The upright cylinder around the body at all times: its axis is what it turns about at first.
  measure() {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    const reach = reachOf(this.components, this.size);
    const place = (i) => this.low[i % 3] + this.step[i % 3] * this.packed[i];
    for (let i = 0; i < this.packed.length; i += 1) {
      const axis = i % 3;
      const value = place(i);
      const more = reach[i % this.size];
      if (value - more < low[axis]) low[axis] = value - more;
      if (value + more > high[axis]) high[axis] = value + more;
    }
    this.centre = low.map((value, axis) => (value + high[axis]) / 2);
    this.height = high[1] - low[1];
    let square = 0;
    for (let i = 0; i < this.packed.length; i += 3) {
      const x = place(i) - this.centre[0];
      const z = place(i + 2) - this.centre[2];
      square = Math.max(square, x * x + z * z);
    }
    this.radius = Math.sqrt(square);
  }

  show(time) {
    const place = time * (this.nFrames - 1);
    const first = Math.min(Math.floor(place), Math.max(this.nFrames - 2, 0));
    const share = place - first;
    const start = first * this.size;
    const next = this.nFrames > 1 ? start + this.size : start;
    for (let i = 0; i < this.size; i += 1) {
      const axis = i % 3;
      const value = this.packed[start + i] * (1 - share) + this.packed[next + i] * share;
      this.positions[i] = this.low[axis] + this.step[axis] * value - this.centre[axis];
    }
    mix(this.components, this.positions);
    this.geometry.attributes.position.needsUpdate = true;
    this.geometry.computeVertexNormals();
    this.geometry.computeBoundingSphere();
    if (this.ground) {
      if (this.components.length) this.lift = this.ground.lowerTo(this.positions);
      this.ground.cast(this.positions);
    }
    this.turnAbout(this.pivot);
  }

  // Keep a vertex where the body turns, at all times; null stands for the axis of the body.
  turnAbout(vertex) {
    this.pivot = vertex;
    const [x, y, z] = vertex === null ? [0, 0, 0] : this.positions.slice(3 * vertex, 3 * vertex + 3);
    this.mesh.position.set(-x, (vertex === null ? this.lift : 0) - y, -z);
  }

  // What the pointer is on: the body's name, a value and the part of the body.
  describe({ face, vertex }, name, part) {
    let value = "";
    if (this.values) {
      const number = this.values[this.hasVertexValues ? vertex : face];
      const digits = number.toPrecision(3).replace("-", "\u2212");
      value = `${this.signed && number > 0 ? "+" : ""}${digits} ${this.valueLabel}`.trim();
    }
    const said = value && part ? `${value} (${part})` : value || part;
    return [this.label || name, said].filter(Boolean).join(": ");
  }
}
