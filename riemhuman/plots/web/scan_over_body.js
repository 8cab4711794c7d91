// A scan over its body: the opacity of both, a cutting plane, and what the scan does not show.
// Part of one script with the other viewer files.
"use strict";

const HATCH = { pixels: 7, light: "#27323d", dark: "#0e1318" };
const EDGE = { body: "#1d2024", scan: "#c2185b" }; // where the plane cuts
// The side that is cut away, in the axes of the body.
const CUTS = { front: [0, 0, 1], left: [1, 0, 0], above: [0, 1, 0] };

// Add to a three.js material a cutting plane, hatching, and discs instead of squares.
function addCutAndHatch(material, uniforms) {
  const before = material.onBeforeCompile;
  material.onBeforeCompile = (shader, renderer) => {
    before.call(material, shader, renderer);
    Object.assign(shader.uniforms, uniforms);
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", `#include <common>
attribute float unseen;
attribute vec2 disc;
varying float isUnseen;
varying vec2 onDisc;
varying vec3 inBody;`)
      .replace("#include <begin_vertex>", `#include <begin_vertex>
isUnseen = unseen;
onDisc = disc;
inBody = position;`);
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", `#include <common>
uniform vec4 cut;
uniform vec3 edgeColor;
uniform vec3 hatchColor;
uniform float hatchWidth;
varying float isUnseen;
varying vec2 onDisc;
varying vec3 inBody;`)
      .replace("#include <clipping_planes_fragment>", `#include <clipping_planes_fragment>
float beforeCut = cut.w - dot(inBody, cut.xyz);
if (beforeCut < 0.0 || dot(onDisc, onDisc) > 1.0) discard;`)
      .replace("#include <color_fragment>", `#include <color_fragment>
if (hatchWidth > 0.0 && isUnseen > 0.5) {
  float along = abs(fract((gl_FragCoord.x + gl_FragCoord.y) / hatchWidth) - 0.5);
  diffuseColor.rgb = mix(hatchColor, diffuseColor.rgb, smoothstep(0.10, 0.22, along));
  diffuseColor.a = max(diffuseColor.a, 0.6 * (1.0 - smoothstep(0.10, 0.22, along)));
}
if (beforeCut < 2.0 * fwidth(beforeCut)) diffuseColor = vec4(edgeColor, 1.0);`);
  };
  material.customProgramCacheKey = () => `cut and hatch ${before}`;
}

// Squares at points, perpendicular to their normals; the shader cuts them to discs.
function discsAt(points, normals, radius) {
  const count = points.length / 3;
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
  const squares = {
    positions: new Float32Array(12 * count), normals: new Float32Array(12 * count),
    discs: new Float32Array(8 * count), faces: new Uint32Array(6 * count),
  };
  const [point, across, right, up] = [0, 1, 2, 3].map(() => new THREE.Vector3());
  for (let i = 0; i < count; i += 1) {
    point.fromArray(points, 3 * i);
    across.fromArray(normals, 3 * i).normalize();
    right.set(Math.abs(across.y) < 0.9 ? 0 : 1, Math.abs(across.y) < 0.9 ? 1 : 0, 0).cross(across).normalize();
    up.copy(across).cross(right);
    corners.forEach(([x, y], corner) => {
      const k = 4 * i + corner;
      for (let axis = 0; axis < 3; axis += 1) {
        squares.positions[3 * k + axis] = point.getComponent(axis)
          + radius * (x * right.getComponent(axis) + y * up.getComponent(axis));
        squares.normals[3 * k + axis] = across.getComponent(axis);
      }
      squares.discs.set([x, y], 2 * k);
    });
    squares.faces.set([0, 1, 2, 0, 2, 3].map((corner) => 4 * i + corner), 6 * i);
  }
  return squares;
}

class ScanOverBody extends Panel {
  async prepare(data) {
    this.isOnSurface = true;
    const [places, distances, background, seen, faces, normals] = await Promise.all([
      unpack(data.points, Uint16Array, 3),
      unpack(data.distances, Uint16Array, 1),
      inflate(data.background),
      inflate(data.seen),
      data.faces && unpack(data.faces, Uint32Array, 3),
      data.normals && inflate(data.normals),
    ]);
    this.data = data;
    this.background = background;
    this.seen = seen;
    this.faces = faces;
    this.points = Float32Array.from(places, (value, i) => data.low[i % 3] + data.step[i % 3] * value);
    this.distances = Float32Array.from(new Int16Array(distances.buffer), (value) => value * data.unit.step);
    this.normals = normals && Float32Array.from(new Int8Array(normals.buffer), (value) => value / 127);
    this.cut = new Float32Array([0, 0, 0, 1]);
    this.inputs = {};
    this.part.querySelectorAll("[data-scan]").forEach((input) => {
      this.inputs[input.dataset.scan] = input;
      input.addEventListener("input", () => this.apply());
    });
  }

  choose([body]) {
    if (!this.mesh) {
      this.body = body;
      this.addTo(body);
    }
    this.apply();
  }

  uniforms(edge) {
    return {
      cut: { value: this.cut },
      edgeColor: { value: new THREE.Color(edge) },
      hatchColor: { value: new THREE.Color(HATCH.light) },
      hatchWidth: { value: 0 },
    };
  }

  // The scan moves with the body, whose positions are relative to its middle.
  addTo(body) {
    const points = this.points.map((value, i) => value - body.centre[i % 3]);
    const discs = this.faces ? null : discsAt(points, this.normals, this.data.disc);
    this.perPoint = discs ? 4 : 1;
    const positions = discs ? discs.positions : points;
    this.triangles = discs ? discs.faces : this.faces;
    this.geometry = new THREE.BufferGeometry();
    const set = (name, values, size) =>
      this.geometry.setAttribute(name, new THREE.BufferAttribute(values, size));
    set("position", positions, 3);
    set("color", new Float32Array(positions.length), 3);
    this.geometry.setIndex(new THREE.BufferAttribute(this.triangles, 1));
    if (discs) {
      set("normal", discs.normals, 3);
      set("disc", discs.discs, 2);
    } else {
      this.geometry.computeVertexNormals();
    }
    this.material = new THREE.MeshStandardMaterial({
      roughness: LIGHT.roughness, metalness: 0, vertexColors: true, side: THREE.DoubleSide,
    });
    this.uniformsOfScan = this.uniforms(EDGE.scan);
    addCutAndHatch(this.material, this.uniformsOfScan);
    this.mesh = new THREE.Mesh(this.geometry, this.material);
    body.mesh.add(this.mesh);
    const unseen = Float32Array.from(this.seen, (value) => 1 - value);
    body.geometry.setAttribute("unseen", new THREE.BufferAttribute(unseen, 1));
    this.uniformsOfBody = this.uniforms(EDGE.body);
    addCutAndHatch(body.mesh.material, this.uniformsOfBody);
  }

  // Apply the settings of the controls.
  apply() {
    const { inputs, body } = this;
    this.setOpacity(body.mesh.material, inputs.body);
    this.setOpacity(this.material, inputs.scan);
    this.mesh.visible = Number(inputs.scan.value) > 0;
    const side = inputs.cut.value;
    inputs.placing.hidden = !side;
    this.cut.set(side ? [...CUTS[side], this.placeOfCut(CUTS[side])] : [0, 0, 0, 1]);
    body.mesh.material.side = side ? THREE.DoubleSide : 0;
    this.uniformsOfBody.hatchWidth.value = inputs.hatch && inputs.hatch.checked
      ? HATCH.pixels * this.viewer.renderer.getPixelRatio() : 0;
    this.color(inputs.colors.checked);
    const aside = inputs.background && inputs.background.checked;
    this.geometry.setDrawRange(0, this.triangles.length);
    if (inputs.background) this.show(aside);
    this.viewer.draw();
  }

  setOpacity(material, input) {
    const opacity = Number(input.value) / 100;
    input.setAttribute("aria-valuetext", `${input.value} % opaque`);
    Object.assign(material, { opacity, transparent: opacity < 1, depthWrite: opacity === 1 });
    material.needsUpdate = true;
  }

  // Metres along a direction, from one end of the body to the other.
  placeOfCut(direction) {
    const { positions } = this.body;
    let [low, high] = [Infinity, -Infinity];
    for (let i = 0; i < positions.length; i += 3) {
      const along = direction[0] * positions[i] + direction[1] * positions[i + 1] + direction[2] * positions[i + 2];
      low = Math.min(low, along);
      high = Math.max(high, along);
    }
    return low + ((high - low) * Number(this.inputs.place.value)) / Number(this.inputs.place.max);
  }

  color(byDistance) {
    const colors = this.geometry.attributes.color;
    const plain = new THREE.Color("#b9c4cf");
    const stops = this.data.scale.map((color) => new THREE.Color(color));
    const mixed = new THREE.Color();
    this.distances.forEach((distance, point) => {
      const share = 0.5 + 0.5 * Math.min(1, Math.max(-1, distance / this.data.limit));
      const place = Math.min(share * (stops.length - 1), stops.length - 1.001);
      mixed.copy(stops[Math.floor(place)]).lerp(stops[Math.floor(place) + 1], place % 1);
      const color = byDistance && !this.background[point] ? mixed : plain;
      for (let corner = 0; corner < this.perPoint; corner += 1) {
        color.toArray(colors.array, 3 * (this.perPoint * point + corner));
      }
    });
    colors.needsUpdate = true;
  }

  // Draw or hide the points that do not belong to the body.
  show(withBackground) {
    if (this.showsBackground === withBackground) return;
    this.showsBackground = withBackground;
    const pointOf = (corner) => Math.floor(corner / this.perPoint);
    const drawn = [];
    for (let i = 0; i < this.triangles.length; i += 3) {
      const corners = this.triangles.slice(i, i + 3);
      if (withBackground || corners.every((corner) => !this.background[pointOf(corner)])) drawn.push(...corners);
    }
    this.geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(drawn), 1));
  }

  // What the pointer is on: the scan with its distance, unless the body hides it.
  describe(place, hit, text) {
    const first = (mesh) => this.viewer.ray.intersectObject(mesh, false)
      .find(({ point }) => this.isBeforeCut(mesh, point)) || null;
    const onScan = this.mesh.visible ? first(this.mesh) : null;
    const onBody = first(this.body.mesh);
    const isOpaque = Number(this.inputs.body.value) > 99;
    if (onScan && !(isOpaque && onBody && onBody.distance < onScan.distance)) {
      const point = Math.floor(onScan.face.a / this.perPoint);
      if (this.background[point]) return "Floor, hair or stray point";
      const distance = this.distances[point];
      const where = distance < 0 ? "inside" : "outside";
      const { digits, name } = this.data.unit;
      const part = hit && this.viewer.parts ? this.viewer.parts.names[this.viewer.parts.numbers[hit.face]] : "";
      const ofBody = part ? ` (${part})` : "";
      return `${Math.abs(distance).toFixed(digits)} ${name} ${where} the body${ofBody}`;
    }
    if (!onBody) return "";
    const isUnseen = !this.seen[onBody.face.a];
    return isUnseen ? [text, "not scanned"].filter(Boolean).join(", ") : text;
  }

  isBeforeCut(mesh, point) {
    const [x, y, z] = mesh.worldToLocal(point.clone()).toArray();
    return this.cut[0] * x + this.cut[1] * y + this.cut[2] * z < this.cut[3];
  }
}
PANELS.scan = ScanOverBody;
