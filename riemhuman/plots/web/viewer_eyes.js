// Eyeballs in the sockets of the open body model: drawn with a body, no part of its data.
// Part of one script with the other viewer files; riemhuman/plots/_eyes.py says how they follow.
"use strict";

const EYE_FRAME = 4; // centre and three half axes

// What the eyes of all bodies of a page share; undefined for other meshes.
async function unpackEyes(data) {
  if (!data) return undefined;
  const [weights, ball, faces, shares] = await Promise.all(
    [data.weights, data.ball, data.faces, data.shares].map(inflate),
  );
  return {
    sockets: data.sockets,
    weights: new Float32Array(weights.buffer),
    ball: new Float32Array(ball.buffer),
    faces: new Uint32Array(faces.buffer),
    shares,
  };
}

// Both eyes of a body, in its material, so that cuts and opacity apply to them too.
class Eyes {
  constructor(body, shared) {
    this.body = body;
    Object.assign(this, shared);
    this.meshes = this.sockets.map((socket, side) => {
      const geometry = new THREE.BufferGeometry();
      const size = this.ball.length / 3;
      const set = (name, width) =>
        geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(width * size), width));
      set("position", 3);
      set("normal", 3);
      set("color", 3);
      if (body.values) set("value", 1);
      geometry.setIndex(new THREE.BufferAttribute(this.faces, 1));
      const mesh = new THREE.Mesh(geometry, body.mesh.material);
      mesh.frustumCulled = false;
      mesh.userData = { socket, side };
      body.mesh.add(mesh);
      return mesh;
    });
    this.paint();
  }

  // Follow the body after its positions have changed.
  show() {
    const { positions } = this.body;
    this.meshes.forEach(({ geometry, userData: { socket, side } }) => {
      const frame = new Float32Array(3 * EYE_FRAME);
      const first = side * EYE_FRAME * socket.length;
      for (let row = 0; row < EYE_FRAME; row += 1) {
        socket.forEach((vertex, k) => {
          const weight = this.weights[first + row * socket.length + k];
          for (let axis = 0; axis < 3; axis += 1) frame[3 * row + axis] += weight * positions[3 * vertex + axis];
        });
      }
      const { position, normal } = geometry.attributes;
      for (let i = 0; i < this.ball.length; i += 1) {
        const axis = i % 3;
        const point = i - axis;
        position.array[i] = frame[axis] + this.ball[point] * frame[3 + axis]
          + this.ball[point + 1] * frame[6 + axis] + this.ball[point + 2] * frame[9 + axis];
      }
      smoothNormals(position.array, this.faces, normal.array);
      position.needsUpdate = true;
      normal.needsUpdate = true;
    });
  }

  // Draw pupils; if values colour the body, in the mean colour of the socket.
  paint() {
    const { geometry, values } = this.body;
    this.meshes.forEach((mesh) => {
      const { color, value } = mesh.geometry.attributes;
      const mean = (attribute, k) => mesh.userData.socket.reduce(
        (sum, vertex) => sum + attribute.array[attribute.itemSize * vertex + k], 0,
      ) / mesh.userData.socket.length;
      const around = values && [0, 1, 2].map((k) => mean(geometry.attributes.color, k));
      color.array.forEach((_, i) => {
        color.array[i] = (around ? around[i % 3] : 1) * this.shares[Math.floor(i / 3)] / 255;
      });
      color.needsUpdate = true;
      if (value && geometry.attributes.value) {
        value.array.fill(mean(geometry.attributes.value, 0));
        value.needsUpdate = true;
      }
    });
  }
}
