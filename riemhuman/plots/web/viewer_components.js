// Sliders of principal components. Part of one script with the other viewer files.
"use strict";

const MOST_DEVIATIONS = 3;

// Displacements of vertices for one standard deviation, or for its square, in metres.
async function unpackChanges({ step, changes }) {
  const numbers = await unpack(changes, Uint16Array, 3);
  return Float32Array.from(new Int16Array(numbers.buffer), (number) => step * number);
}

const unpackComponents = (components) => Promise.all((components || []).map(async (each) => ({
  linear: await unpackChanges(each.linear),
  quadratic: await unpackChanges(each.quadratic),
  score: 0,
})));

// Add the changes by the scores of all components to positions.
function mix(components, positions) {
  components.forEach(({ linear, quadratic, score }) => {
    if (!score) return;
    for (let i = 0; i < positions.length; i += 1) {
      positions[i] += score * (linear[i] + score * quadratic[i]);
    }
  });
}

// How far components can move each coordinate, at three standard deviations in any direction.
function reachOf(components, size) {
  const reach = new Float32Array(size);
  components.forEach(({ linear }) => linear.forEach((value, i) => { reach[i] += value * value; }));
  return reach.map((square) => MOST_DEVIATIONS * Math.sqrt(square));
}

// A standard normal number (Box and Muller), limited to the range of the sliders.
function normalNumber() {
  const radius = Math.sqrt(-2 * Math.log(1 - Math.random()));
  const number = radius * Math.cos(2 * Math.PI * Math.random());
  return Math.min(MOST_DEVIATIONS, Math.max(-MOST_DEVIATIONS, number));
}

class Sliders {
  constructor(viewer) {
    this.viewer = viewer;
    this.part = viewer.find("components");
    this.rows = this.part ? [...this.part.querySelectorAll("label")] : [];
    this.inputs = this.rows.map((row) => row.querySelector("input"));
    this.inputs.forEach((input) => input.addEventListener("input", () => this.apply()));
  }

  // Show the sliders only with the body that they change.
  choose(bodies) {
    if (this.part) this.part.hidden = !bodies.some((body) => body.components.length);
  }

  set(scoreOf) {
    this.inputs.forEach((input) => { input.value = String(scoreOf()); });
    this.apply();
  }

  apply() {
    const scores = this.inputs.map((input) => Number(input.value));
    this.rows.forEach((row, k) => {
      const score = scores[k].toFixed(2).replace("-", "\u2212");
      row.querySelector("output").textContent = score;
      this.inputs[k].setAttribute("aria-valuetext", `${score} standard deviations`);
    });
    this.viewer.bodies().forEach((body) => {
      body.components.forEach((component, k) => { component.score = scores[k]; });
    });
    this.viewer.hideHint();
    this.viewer.seek(this.viewer.time);
  }
}
