// Colours of values: a bar with movable ends, and lines of equal value.
// Part of one script with the other viewer files.
"use strict";

const NARROWEST = 0.02; // least distance between the ends, as a share of the bar
const MOST_ENDS = 2; // how far the ends can be moved, in first ends
const N_LINES = 10; // approximate number between the ends

const LINE_VERTEX = "#include <begin_vertex>\nreading = value;";
const LINE_FRAGMENT = `#include <color_fragment>
if (lineStep > 0.0) {
  float at = reading / lineStep;
  float wide = max(fwidth(at), 1e-6);
  float near = abs(fract(at - 0.5) - 0.5) / wide;
  float thick = abs(at) < 0.5 ? 1.9 : 1.2; // that of 0 is thicker
  // Lines closer than two pixels would be a dark area.
  diffuseColor.rgb *= 1.0 - 0.7 * clamp(thick - near, 0.0, 1.0) * clamp(0.6 / wide - 0.5, 0.0, 1.0);
}`;

// A number with two significant digits and a true minus sign.
const textOf = (number, signed) =>
  `${signed && number > 0 ? "+" : ""}${Number(number.toPrecision(2))}`.replace("-", "\u2212");

// 1, 2 or 5 times a power of ten, near a number.
function roundStep(number) {
  const power = 10 ** Math.floor(Math.log10(number));
  const digit = number / power;
  return power * (digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10);
}

// Values of vertices: given, or means over their triangles with known values.
function readings(body) {
  if (body.hasVertexValues) return body.values;
  const sums = new Float32Array(body.positions.length / 3);
  const counts = new Float32Array(sums.length);
  body.faces.forEach((vertex, i) => {
    const value = body.values[Math.floor(i / 3)];
    if (Number.isNaN(value)) return;
    sums[vertex] += value;
    counts[vertex] += 1;
  });
  return sums.map((sum, vertex) => (counts[vertex] ? sum / counts[vertex] : NaN));
}

// The colours of one body's values. The bar goes from 0, or from minus the largest value if
// values have a sign, to the largest; values beyond an end have its colour.
class ValueScale {
  constructor(body, colors) {
    this.body = body;
    this.signed = body.signed;
    this.colors = colors;
    this.stops = colors.map((color) => [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16)));
    this.values = readings(body);
    let largest = body.largest;
    body.values.forEach((value) => {
      if (!Number.isNaN(value)) largest = Math.max(largest, Math.abs(value));
    });
    largest = Math.min(largest, MOST_ENDS * body.largest || largest);
    this.limits = [this.signed ? -largest : 0, largest];
    this.first = [this.signed ? -body.largest : 0, body.largest];
    this.ends = this.first;
    this.lineStep = { value: 0 };
    this.drawLines();
  }

  drawLines() {
    const { geometry, mesh } = this.body;
    geometry.setAttribute("value", new THREE.BufferAttribute(Float32Array.from(this.values), 1));
    if (this.body.smooth) this.body.smooth.paint();
    if (this.body.eyes) this.body.eyes.paint();
    mesh.material.onBeforeCompile = (shader) => {
      shader.uniforms.lineStep = this.lineStep;
      shader.vertexShader = `attribute float value;\nvarying float reading;\n${
        shader.vertexShader.replace("#include <begin_vertex>", LINE_VERTEX)}`;
      shader.fragmentShader = `uniform float lineStep;\nvarying float reading;\n${
        shader.fragmentShader.replace("#include <color_fragment>", LINE_FRAGMENT)}`;
    };
  }

  // Whether another body's values share this bar.
  isLike(other) {
    return this.signed === other.signed && this.body.valueLabel === other.body.valueLabel
      && this.body.largest === other.body.largest;
  }

  step() {
    return roundStep((this.ends[1] - this.ends[0]) / N_LINES);
  }

  share(value) {
    return (value - this.limits[0]) / (this.limits[1] - this.limits[0] || 1);
  }

  // Move an end, 0 or 1; those of a scale with a sign stay on both sides of 0.
  place(end, value) {
    const narrowest = NARROWEST * (this.limits[1] - this.limits[0]);
    if (this.signed) {
      const size = Math.min(this.limits[1], Math.max(narrowest / 2, end ? value : -value));
      this.ends = [-size, size];
    } else if (end) {
      this.ends = [this.ends[0], Math.min(this.limits[1], Math.max(this.ends[0] + narrowest, value))];
    } else {
      this.ends = [Math.max(this.limits[0], Math.min(this.ends[1] - narrowest, value)), this.ends[1]];
    }
    this.paint();
  }

  reset() {
    this.ends = this.first;
    this.paint();
  }

  paint() {
    const { array } = this.body.geometry.attributes.color;
    const [low, high] = this.ends;
    const last = this.stops.length - 1;
    this.values.forEach((value, vertex) => {
      if (Number.isNaN(value)) return; // not known, and grey
      const place = last * Math.min(1, Math.max(0, (value - low) / (high - low || 1)));
      const before = Math.min(Math.floor(place), last - 1);
      for (let k = 0; k < 3; k += 1) {
        const [a, b] = [this.stops[before][k], this.stops[before + 1][k]];
        array[3 * vertex + k] = linear(a + (place - before) * (b - a));
      }
    });
    this.body.geometry.attributes.color.needsUpdate = true;
    if (this.body.smooth) this.body.smooth.paint();
    if (this.body.eyes) this.body.eyes.paint();
  }
}

// The bars in the labels of bodies, and the checkbox of the lines.
class ValueBars {
  constructor(viewer) {
    this.viewer = viewer;
    this.bars = [];
    this.control = viewer.find("lines");
    if (this.control) this.control.querySelector("input").addEventListener("change", () => this.update());
  }

  // Start again with the bodies that are shown.
  choose(bodies) {
    this.bars = [];
    if (this.control) this.control.hidden = !bodies.some((body) => body.values);
    // Otherwise, the names of the choices label the bodies.
    if (bodies.some((body) => body.values)) this.viewer.find("labels").removeAttribute("aria-hidden");
  }

  // The bar of a body's values, with a handle at each end.
  write(body, label) {
    body.scaleOfValues ||= new ValueScale(body, body.scale || this.viewer.data.scale);
    const part = (parent, kind, name = "") => {
      const element = document.createElement(kind);
      element.className = name;
      parent.append(element);
      return element;
    };
    const row = part(label, "span", "scale");
    const numbers = [part(row, "span")];
    const bar = part(row, "i");
    numbers.push(part(row, "span"));
    if (body.valueCaption) part(label, "span", "caption").textContent = body.valueCaption;
    const handles = ["Lowest", "Highest"].map((name, end) => {
      const handle = part(bar, "b");
      handle.tabIndex = 0;
      handle.setAttribute("role", "slider");
      handle.setAttribute("aria-label", `${name} value of the colours${body.label ? ` of ${body.label}` : ""}`);
      this.listen(handle, bar, body.scaleOfValues, end);
      return handle;
    });
    this.bars.push({ scale: body.scaleOfValues, bar, numbers, handles });
    this.update();
  }

  listen(handle, bar, scale, end) {
    const move = (value) => {
      this.bars.filter((each) => each.scale.isLike(scale)).forEach((each) => each.scale.place(end, value));
      this.update();
    };
    const reset = () => {
      this.bars.filter((each) => each.scale.isLike(scale)).forEach((each) => each.scale.reset());
      this.update();
    };
    handle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      handle.focus();
      handle.setPointerCapture(event.pointerId);
    });
    handle.addEventListener("pointermove", (event) => {
      if (!handle.hasPointerCapture(event.pointerId)) return;
      const box = bar.getBoundingClientRect();
      const share = (event.clientX - box.left) / box.width;
      move(scale.limits[0] + share * (scale.limits[1] - scale.limits[0]));
    });
    handle.addEventListener("dblclick", reset);
    handle.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -5, PageUp: 5 }[event.key];
      if (steps === undefined && event.key !== "Home") return;
      event.preventDefault();
      event.stopPropagation();
      if (steps === undefined) reset();
      else move(scale.ends[end] + steps * NARROWEST * (scale.limits[1] - scale.limits[0]));
    });
  }

  // Write and draw the ends of all bars, and the distance of the lines.
  update() {
    const on = Boolean(this.control) && this.control.querySelector("input").checked;
    this.bars.forEach(({ scale, bar, numbers, handles }) => {
      const places = scale.ends.map((value) => scale.share(value));
      scale.ends.forEach((value, end) => {
        const unit = end ? ` ${scale.body.valueLabel}`.trimEnd() : "";
        numbers[end].textContent = `${textOf(value, scale.signed)}${unit}`;
        handles[end].style.left = `${100 * places[end]}%`;
        handles[end].setAttribute("aria-valuemin", scale.limits[0]);
        handles[end].setAttribute("aria-valuemax", scale.limits[1]);
        handles[end].setAttribute("aria-valuenow", value);
        handles[end].setAttribute("aria-valuetext", `${textOf(value, scale.signed)} ${scale.body.valueLabel}`.trim());
      });
      const last = scale.colors.length - 1;
      const stops = scale.colors.map((_, k) => places[0] + (k / last) * (places[1] - places[0]));
      bar.dataset.colors = scale.colors.join(",");
      bar.dataset.stops = stops.join(",");
      bar.style.background = `linear-gradient(to right, ${
        scale.colors.map((color, k) => `${color} ${100 * stops[k]}%`).join(", ")})`;
      scale.lineStep.value = on ? scale.step() : 0;
    });
    if (this.control) {
      const [first] = this.bars;
      const every = first && on ? `, every ${textOf(first.scale.step())} ${first.scale.body.valueLabel}`.trimEnd() : "";
      this.control.querySelector("span").textContent = `Lines of equal value${every}`;
    }
    this.viewer.draw();
  }
}
