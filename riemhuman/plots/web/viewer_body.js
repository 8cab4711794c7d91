// One body of a viewer. Part of one script with the other viewer files.
"use strict";

// Inflate compressed bytes.
async function inflate(text) {
  const packed = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Decode rows of integers, stored as differences of rows with bytes grouped by significance.
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

// The share of light that a value of sRGB from 0 to 255 stands for.
const linear = (value) =>
  value > 10 ? Math.pow((value / 255 + 0.055) / 1.055, 2.4) : value / 255 / 12.92;

// Unit normals of vertices: area-weighted means of the normals of their triangles.
function smoothNormals(positions, faces, normals) {
  normals.fill(0);
  for (let i = 0; i < faces.length; i += 3) {
    const a = 3 * faces[i];
    const b = 3 * faces[i + 1];
    const c = 3 * faces[i + 2];
    const ux = positions[b] - positions[a];
    const uy = positions[b + 1] - positions[a + 1];
    const uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a];
    const vy = positions[c + 1] - positions[a + 1];
    const vz = positions[c + 2] - positions[a + 2];
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    normals[a] += nx;
    normals[a + 1] += ny;
    normals[a + 2] += nz;
    normals[b] += nx;
    normals[b + 1] += ny;
    normals[b + 2] += nz;
    normals[c] += nx;
    normals[c + 1] += ny;
    normals[c + 2] += nz;
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.sqrt(normals[i] ** 2 + normals[i + 1] ** 2 + normals[i + 2] ** 2) || 1;
    normals[i] /= length;
    normals[i + 1] /= length;
    normals[i + 2] /= length;
  }
}

// Vertices of one body at all times, and its surface in the scene.
class Body {
  static async from(data, faces, nVertices, { shade, eyes, flat }) {
    const [frames, values, colors, components] = await Promise.all([
      framesOf(data, nVertices),
      data.values && inflate(data.values),
      data.colors && inflate(data.colors),
      unpackComponents(data.components),
    ]);
    const numbers = values && new Float32Array(values.buffer);
    return new Body(data, faces, nVertices, { frames, values: numbers, colors, components, shade, eyes, flat });
  }

  constructor(data, faces, nVertices, { frames, values, colors, components, shade, eyes, flat }) {
    this.label = data.label;
    this.nFrames = frames.nFrames;
    this.frames = frames;
    this.track = data.track; // places of the ground in each frame, where the view follows the body
    this.times = data.times; // frames at equally spaced times, where that is not each frame once
    this.nTimes = this.times ? this.times.length : this.nFrames;
    this.faces = faces;
    this.components = components;
    this.lift = 0; // so that a body that components change stands on the ground
    this.values = values;
    // Otherwise, there is one value per triangle.
    this.hasVertexValues = Boolean(values) && values.length !== faces.length / 3;
    this.largest = data.largest;
    this.signed = Boolean(data.signed);
    this.scale = data.scale;
    this.valueLabel = data.value_label;
    this.valueCaption = data.value_caption || "";
    this.geometry = new THREE.BufferGeometry();
    this.positions = new Float32Array(3 * nVertices);
    this.normals = new Float32Array(3 * nVertices);
    this.geometry.setAttribute("position", new THREE.BufferAttribute(this.positions, 3));
    this.geometry.setAttribute("normal", new THREE.BufferAttribute(this.normals, 3));
    this.geometry.setIndex(new THREE.BufferAttribute(faces, 1));
    const material = new THREE.MeshStandardMaterial({ roughness: LIGHT.roughness, metalness: 0 });
    if (colors) {
      this.geometry.setAttribute("color", new THREE.BufferAttribute(Float32Array.from(colors, linear), 3));
      material.vertexColors = true;
    } else {
      material.color = new THREE.Color(data.color);
      if (shade) {
        // Darken folds, but never colours that show values.
        const shares = Float32Array.from(this.positions, (_, i) => shade[Math.floor(i / 3)] / 255);
        this.geometry.setAttribute("color", new THREE.BufferAttribute(shares, 3));
        material.vertexColors = true;
      }
    }
    // Of other meshes, it is not known that they are round.
    this.smooth = shade && nVertices < COARSE && !flat ? new SmoothSurface(this.geometry) : null;
    this.mesh = new THREE.Mesh((this.smooth || this).geometry, material);
    this.eyes = eyes && new Eyes(this, eyes);
    this.turning = new THREE.Group();
    this.turning.add(this.mesh);
    this.holder = new THREE.Group();
    this.holder.add(this.turning);
    this.pivot = null;
    this.measure();
    this.floor = data.ground - this.centre[1];
    this.show(0);
    this.ground = new Ground(this, faces);
    this.mesh.add(this.ground.disc);
    this.show(0);
  }

  // The upright cylinder around the body at all times; the body first turns about its axis.
  measure() {
    const reach = reachOf(this.components, this.positions.length);
    Object.assign(this, this.frames.measure(reach));
    // Covers all times, so that it is computed only once.
    this.geometry.computeBoundingSphere();
    this.geometry.boundingSphere.radius = Math.hypot(this.radius, this.height / 2);
    this.mesh.geometry.boundingSphere = this.geometry.boundingSphere;
  }

  // The frame, or a position between two frames, at a share of the duration.
  placeAt(time) {
    if (!this.times) return time * (this.nFrames - 1);
    const { first, next, share } = between(time * (this.times.length - 1), this.times.length);
    return this.times[first] * (1 - share) + this.times[next] * share;
  }

  show(time) {
    this.place = this.placeAt(time);
    this.frames.pose(this.place, this.positions);
    mix(this.components, this.positions);
    this.geometry.attributes.position.needsUpdate = true;
    smoothNormals(this.positions, this.faces, this.normals);
    this.geometry.attributes.normal.needsUpdate = true;
    if (this.smooth) this.smooth.show();
    if (this.eyes) this.eyes.show();
    if (this.ground) {
      if (this.track) this.ground.pass(this.passed());
      if (this.components.length) this.lift = this.ground.lowerTo(this.positions);
      this.ground.cast(this.positions);
    }
    this.turnAbout(this.pivot);
  }

  // How far the ground has moved at the moment that is shown.
  passed() {
    const { first, next, share } = between(this.place, this.nFrames);
    return [0, 1].map((axis) => this.track[first][axis] * (1 - share) + this.track[next][axis] * share);
  }

  // Turn about a vertex at all times; null means the axis of the body.
  turnAbout(vertex) {
    this.pivot = vertex;
    const [x, y, z] = vertex === null ? [0, 0, 0] : this.positions.slice(3 * vertex, 3 * vertex + 3);
    this.mesh.position.set(-x, (vertex === null ? this.lift : 0) - y, -z);
  }

  // What the pointer is on: the body's name, a value and the part of the body.
  describe({ face, vertex }, name, part) {
    const value = this.values ? this.valueText(this.hasVertexValues ? vertex : face) : "";
    const valueAndPart = value && part ? `${value} (${part})` : value || part;
    return [this.label || name, valueAndPart].filter(Boolean).join(": ");
  }

  valueText(index) {
    const number = this.values[index];
    if (Number.isNaN(number)) return "not known";
    const sign = this.signed && number > 0 ? "+" : "";
    return `${sign}${number.toPrecision(3).replace("-", "\u2212")} ${this.valueLabel}`.trim();
  }
}
