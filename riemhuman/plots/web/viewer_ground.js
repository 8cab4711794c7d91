// The ground below one body: a disc with a fading grid, and the shadow of the body.
// Part of one script with the other viewer files.
"use strict";

const CELLS = GROUND.cells; // GROUND is ground.json, which _ground_picture.py explains
const DARK = window.matchMedia("(prefers-color-scheme: dark)");

const GROUND_VERTEX = `
varying vec2 place;
void main() {
  place = position.xy;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const GROUND_FRAGMENT = `
uniform sampler2D shadow;
uniform vec2 centre;
uniform vec3 ink;
uniform float radius;
uniform float spacing;
uniform float darkest;
varying vec2 place;

// How much of this pixel a grid line covers; lines closer than two pixels become grey.
float line(float spacing) {
  vec2 at = (place + centre) / spacing;
  vec2 wide = fwidth(at);
  vec2 near = abs(fract(at - 0.5) - 0.5) / max(wide, vec2(1e-6));
  vec2 drawn = clamp(1.2 - near, 0.0, 1.0) * clamp(0.6 / max(wide, vec2(1e-6)) - 0.5, 0.0, 1.0);
  return max(drawn.x, drawn.y);
}

void main() {
  float fade = 1.0 - smoothstep(0.35, 1.0, length(place) / radius);
  float grid = fade * (${GROUND.grid.toFixed(2)} + max(${GROUND.line.toFixed(2)} * line(spacing),
    ${GROUND.strong_line.toFixed(2)} * line(${GROUND.strong.toFixed(1)} * spacing)));
  float dark = darkest * (1.0 - smoothstep(0.6, 1.0, length(place) / radius))
    * texture2D(shadow, 0.5 + 0.5 * place / radius).r;
  // The shadow lies over the grid.
  float opacity = dark + grid * (1.0 - dark);
  gl_FragColor = vec4(ink * grid * (1.0 - dark) / max(opacity, 1e-4), opacity);
}`;

class Ground {
  constructor(body, faces) {
    this.floor = body.floor; // positions are relative to the middle of the body
    this.standing = body.floor;
    this.middle = new THREE.Vector2(body.centre[0], -body.centre[2]);
    this.height = body.height;
    this.radius = 1.15 * Math.max(body.radius, 0.3 * body.height);
    // Count each vertex as the same share of the surface.
    this.share = surfaceArea(body.positions, faces) / (body.positions.length / 3);
    this.shadow = new Uint8Array(CELLS * CELLS);
    this.texture = new THREE.DataTexture(
      this.shadow, CELLS, CELLS, THREE.RedFormat, THREE.UnsignedByteType,
    );
    this.texture.magFilter = THREE.LinearFilter;
    this.texture.minFilter = THREE.LinearFilter;
    const material = new THREE.ShaderMaterial({
      vertexShader: GROUND_VERTEX,
      fragmentShader: GROUND_FRAGMENT,
      transparent: true,
      depthWrite: false,
      side: THREE.DoubleSide,
      uniforms: {
        shadow: { value: this.texture },
        centre: { value: this.middle.clone() },
        ink: { value: new THREE.Color() },
        radius: { value: this.radius },
        spacing: { value: GROUND.spacing },
        darkest: { value: GROUND.darkest },
      },
    });
    this.uniforms = material.uniforms;
    this.ink();
    this.disc = new THREE.Mesh(new THREE.CircleGeometry(this.radius, 64), material);
    this.disc.rotation.x = -Math.PI / 2;
    this.disc.position.y = this.floor;
  }

  // Move the lines by how far the ground has passed below a body that the view follows.
  pass([right, forward]) {
    this.uniforms.centre.value.set(this.middle.x + right, this.middle.y - forward);
  }

  // Move below the lowest point; return how far the body has to be raised.
  lowerTo(positions) {
    let lowest = Infinity;
    for (let i = 1; i < positions.length; i += 3) lowest = Math.min(lowest, positions[i]);
    this.floor = lowest;
    this.disc.position.y = lowest;
    return this.standing - lowest;
  }

  // Draw lines and shadow in the colour of the theme.
  ink() {
    this.uniforms.ink.value.set(DARK.matches ? GROUND.ink.dark : GROUND.ink.light);
  }

  // The shadow of a surface: how much of it is above each cell, darker where it is lower.
  cast(positions) {
    const light = new Float32Array(CELLS * CELLS).fill(1);
    const cellArea = ((2 * this.radius) / CELLS) ** 2;
    const scale = CELLS / (2 * this.radius);
    GROUND.layers.forEach((layer) => {
      const cover = new Float32Array(CELLS * CELLS);
      for (let i = 0; i < positions.length; i += 3) {
        const column = Math.floor((positions[i] + this.radius) * scale);
        const row = Math.floor((this.radius - positions[i + 2]) * scale);
        if (column < 0 || row < 0 || column >= CELLS || row >= CELLS) continue;
        const above = Math.max(positions[i + 1] - this.floor, 0) / this.height;
        cover[row * CELLS + column] += Math.exp(-above / layer.height) * (this.share / cellArea);
      }
      for (let time = 0; time < 2; time += 1) blur(cover, layer.blur);
      cover.forEach((value, cell) => { light[cell] *= 1 - layer.strength * (1 - Math.exp(-value)); });
    });
    light.forEach((value, cell) => { this.shadow[cell] = Math.round(255 * (1 - value)); });
    this.texture.needsUpdate = true;
  }
}

// Means of neighbouring cells, along rows and then along columns.
function blur(cells, radius) {
  const line = new Float32Array(CELLS);
  [[1, CELLS], [CELLS, 1]].forEach(([step, next]) => {
    for (let start = 0; start < CELLS; start += 1) {
      let sum = 0;
      for (let i = -radius; i < CELLS; i += 1) {
        if (i + radius < CELLS) sum += cells[start * next + (i + radius) * step];
        if (i - radius - 1 >= 0) sum -= cells[start * next + (i - radius - 1) * step];
        if (i >= 0) line[i] = Math.max(sum, 0) / (2 * radius + 1);
      }
      line.forEach((value, i) => { cells[start * next + i * step] = value; });
    }
  });
}

function surfaceArea(positions, faces) {
  let area = 0;
  const [a, b, c] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
  for (let i = 0; i < faces.length; i += 3) {
    a.fromArray(positions, 3 * faces[i]);
    b.fromArray(positions, 3 * faces[i + 1]).sub(a);
    c.fromArray(positions, 3 * faces[i + 2]).sub(a);
    area += b.cross(c).length() / 2;
  }
  return area;
}
