// A list of measurements beside bodies: pointing at a row shows its line, and the other way round.
// Part of one script with the other viewer files.
"use strict";

const TUBE = { thin: 0.0016, thick: 0.0045, sides: 6 }; // radii in metres
const LINE_COLOR = { plain: "#1f5f99", onValues: "#16181c" }; // blue is a value
const LIT_COLOR = "#d1105a";
const NEAR_LINE = 9; // pixels
const BEHIND_SKIN = 0.03; // metres: lines a little inside the body still count as in front of it

// A tube along each polyline, of prisms between successive points.
function tubesAlong(polylines, radius) {
  const positions = [];
  const faces = [];
  const [from, to, along, right, up, corner] = [0, 1, 2, 3, 4, 5].map(() => new THREE.Vector3());
  polylines.forEach((line) => {
    for (let i = 0; i + 5 < line.length; i += 3) {
      from.fromArray(line, i);
      to.fromArray(line, i + 3);
      along.copy(to).sub(from);
      if (along.length() < 1e-6) continue;
      along.normalize();
      right.set(Math.abs(along.y) < 0.9 ? 0 : 1, Math.abs(along.y) < 0.9 ? 1 : 0, 0).cross(along).normalize();
      up.copy(along).cross(right);
      const first = positions.length / 3;
      [from, to].forEach((end) => {
        for (let side = 0; side < TUBE.sides; side += 1) {
          const angle = (2 * Math.PI * side) / TUBE.sides;
          corner.copy(end).addScaledVector(right, radius * Math.cos(angle)).addScaledVector(up, radius * Math.sin(angle));
          positions.push(corner.x, corner.y, corner.z);
        }
      });
      for (let side = 0; side < TUBE.sides; side += 1) {
        const next = (side + 1) % TUBE.sides;
        const [a, b, c, d] = [side, next, side + TUBE.sides, next + TUBE.sides].map((k) => first + k);
        faces.push(a, b, c, b, d, c);
      }
    }
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(positions), 3));
  geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(faces), 1));
  geometry.computeVertexNormals();
  return geometry;
}

class MeasurementList extends Panel {
  async prepare({ bodies }) {
    this.isOnSurface = true;
    // For each body and measurement, its polylines.
    this.lines = await Promise.all(bodies.map(async ({ points, low, step, ends }) => {
      const numbers = await unpack(points, Uint16Array, 3);
      const places = Float32Array.from(numbers, (value, i) => low[i % 3] + step[i % 3] * value);
      let start = 0;
      return ends.map((lengths) => lengths.map((length) => {
        const line = places.slice(3 * start, 3 * (start + length));
        start += length;
        return line;
      }));
    }));
    this.list = this.part.querySelector("[data-part=measurements]");
    this.rows = [...this.list.querySelectorAll("[data-row]")];
    this.groups = [...this.list.querySelectorAll("details")];
    this.lit = null;
    this.listen();
  }

  listen() {
    this.rows.forEach((row) => {
      const number = Number(row.dataset.row);
      row.addEventListener("pointerenter", () => this.light(number));
      row.addEventListener("focus", () => this.light(number));
      row.addEventListener("click", () => this.light(number));
      row.addEventListener("pointerleave", () => this.light(null));
      row.addEventListener("blur", () => this.light(null));
    });
    this.groups.forEach((group) => group.addEventListener("toggle", () => this.showLines()));
    this.list.querySelector("[data-measure=find]").addEventListener("input", (event) => this.find(event.target.value));
  }

  // Show the rows whose names contain the text; groups with matches open during a search.
  find(text) {
    const words = text.trim().toLowerCase();
    this.groups.forEach((group, index) => {
      let count = 0;
      group.querySelectorAll("[data-row]").forEach((row) => {
        row.hidden = !row.querySelector("th").textContent.toLowerCase().includes(words);
        if (!row.hidden) count += 1;
      });
      group.hidden = count === 0;
      group.open = words ? count > 0 : index === 0;
    });
    this.showLines();
  }

  choose(bodies) {
    this.bodies = bodies.slice(0, this.lines.length);
    this.drawn = this.bodies.map((body, index) => this.drawnOn(body, index));
    this.showLines();
  }

  // Thin lines of all measurements on a body and a thick one, built once.
  drawnOn(body, index) {
    if (body.measurementLines) return body.measurementLines;
    const local = this.lines[index].map((lines) => lines.map(
      (line) => line.map((value, i) => value - body.centre[i % 3]),
    ));
    const meshes = local.map((lines) => {
      const material = new THREE.MeshStandardMaterial({ color: body.values ? LINE_COLOR.onValues : LINE_COLOR.plain, roughness: 0.9 });
      const mesh = new THREE.Mesh(tubesAlong(lines, TUBE.thin), material);
      body.mesh.add(mesh);
      return mesh;
    });
    // The thick line also shows faintly through the body.
    const thick = [1, 0.35].map((opacity) => {
      const material = new THREE.MeshStandardMaterial({
        color: LIT_COLOR, roughness: 0.9, transparent: opacity < 1, opacity, depthTest: opacity === 1,
      });
      const mesh = new THREE.Mesh(new THREE.BufferGeometry(), material);
      mesh.renderOrder = 2;
      mesh.visible = false;
      body.mesh.add(mesh);
      return mesh;
    });
    body.measurementLines = { local, meshes, thick };
    return body.measurementLines;
  }

  isShown(number) {
    const row = this.rowOf(number);
    return Boolean(row) && !row.hidden && row.closest("details").open;
  }

  rowOf(number) {
    return this.rows.find((row) => Number(row.dataset.row) === number);
  }

  // Show the lines of the open groups.
  showLines() {
    if (!this.drawn) return;
    this.drawn.forEach(({ meshes }) => meshes.forEach((mesh, number) => { mesh.visible = this.isShown(number); }));
    this.viewer.draw();
  }

  // Highlight a measurement, its row and its lines, or none.
  light(number) {
    if (this.lit === number) return;
    this.lit = number;
    this.rows.forEach((row) => row.classList.toggle("lit", Number(row.dataset.row) === number));
    this.drawn.forEach(({ local, thick }) => thick.forEach((mesh) => {
      mesh.geometry.dispose();
      const lines = number === null ? [] : local[number];
      mesh.geometry = tubesAlong(lines, TUBE.thick);
      mesh.visible = lines.length > 0;
    }));
    this.list.dataset.lit = number === null ? "" : String(number);
    this.viewer.draw();
  }

  describe(place, hit, text) {
    const number = this.nearest(place, hit);
    this.light(number);
    if (number === null) return text;
    const row = this.rowOf(number);
    const box = row.getBoundingClientRect();
    const around = this.part.getBoundingClientRect();
    if (box.top < around.top || box.bottom > around.bottom) this.part.scrollTop += box.top - around.top - around.height / 2;
    const [name, ...values] = [...row.children].map((cell) => cell.textContent);
    return values.length > 1 ? `${name}: ${values[0]} \u2192 ${values[1]} (${values[2]})` : `${name}: ${values[0]}`;
  }

  leave() {
    this.light(null);
  }

  // The number of the measurement whose line is at this place of the stage, unless the body hides it.
  nearest(place, hit) {
    const { camera, stage } = this.viewer;
    const point = new THREE.Vector3();
    const depthOfBody = hit ? this.depthOf(hit) : Infinity;
    let best = { gap: NEAR_LINE, number: null };
    this.drawn.forEach(({ local }, index) => {
      const { mesh } = this.bodies[index];
      local.forEach((lines, number) => {
        if (!this.isShown(number)) return;
        lines.forEach((line) => {
          let before = null;
          for (let i = 0; i < line.length; i += 3) {
            point.fromArray(line, i).applyMatrix4(mesh.matrixWorld);
            const depth = point.distanceTo(camera.position);
            point.project(camera);
            const now = { x: ((point.x + 1) * stage.clientWidth) / 2, y: ((1 - point.y) * stage.clientHeight) / 2, depth };
            if (before && Math.min(before.depth, depth) < depthOfBody + BEHIND_SKIN) {
              const gap = gapToSegment(place, before, now);
              if (gap < best.gap) best = { gap, number };
            }
            before = now;
          }
        });
      });
    });
    return best.number;
  }

  depthOf({ body, vertex }) {
    return new THREE.Vector3().fromArray(body.positions, 3 * vertex)
      .applyMatrix4(body.mesh.matrixWorld).distanceTo(this.viewer.camera.position);
  }
}
PANELS.measurements = MeasurementList;

function gapToSegment(place, from, to) {
  const [x, y] = [to.x - from.x, to.y - from.y];
  const square = x * x + y * y || 1;
  const share = Math.min(1, Math.max(0, ((place.x - from.x) * x + (place.y - from.y) * y) / square));
  return Math.hypot(place.x - from.x - share * x, place.y - from.y - share * y);
}
