// Onion skins: a moving body at a few moments before and after the current one.
// Part of one script with the other viewer files.
"use strict";

const TRAIL = {
  seconds: 0.2, // between the moments of a recording
  share: 0.1, // of a path
  steps: [-3, -2, -1, 1, 2, 3],
  opacity: 0.2, // of the nearest; others are fainter
  colors: { before: "#3f7fbf", after: "#d98a30" },
};

// One body at another moment, drawn over the body itself.
class Ghost {
  constructor(body, step) {
    this.body = body;
    this.step = step;
    this.positions = new Float32Array(body.positions.length);
    this.normals = new Float32Array(body.positions.length);
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute("position", new THREE.BufferAttribute(this.positions, 3));
    this.geometry.setAttribute("normal", new THREE.BufferAttribute(this.normals, 3));
    this.geometry.setIndex(body.geometry.index);
    this.mesh = new THREE.Mesh(this.geometry, new THREE.MeshStandardMaterial({
      color: step < 0 ? TRAIL.colors.before : TRAIL.colors.after,
      roughness: LIGHT.roughness,
      transparent: true,
      opacity: TRAIL.opacity / Math.abs(step) ** 0.5,
      depthWrite: false,
    }));
    this.mesh.frustumCulled = false;
    body.mesh.add(this.mesh);
  }

  show(time) {
    this.mesh.visible = time >= 0 && time <= 1;
    if (!this.mesh.visible) return;
    this.body.frames.pose(this.body.placeAt(time), this.positions);
    smoothNormals(this.positions, this.body.faces, this.normals);
    this.geometry.attributes.position.needsUpdate = true;
    this.geometry.attributes.normal.needsUpdate = true;
  }

  remove() {
    this.body.mesh.remove(this.mesh);
    this.geometry.dispose();
    this.mesh.material.dispose();
  }
}

class Trail {
  constructor(viewer) {
    this.viewer = viewer;
    this.ghosts = [];
    this.switch = viewer.find("trail"); // pages stored by earlier releases have none
    if (this.switch) {
      this.switch.addEventListener("change", () => {
        this.choose(viewer.bodies());
        viewer.seek(viewer.time);
      });
    }
  }

  choose(bodies) {
    this.ghosts.forEach((ghost) => ghost.remove());
    const on = Boolean(this.switch) && this.switch.checked;
    this.ghosts = on
      ? bodies.filter((body) => body.nFrames > 1).flatMap((body) => TRAIL.steps.map((step) => new Ghost(body, step)))
      : [];
  }

  // Bodies are shown at shares of their durations.
  seek(shareOf) {
    const { viewer } = this;
    const gap = viewer.isRecorded() ? TRAIL.seconds / Math.max(viewer.duration(), 1e-6) : TRAIL.share;
    this.ghosts.forEach((ghost) => {
      const time = viewer.time + ghost.step * gap;
      ghost.show(time < 0 || time > 1 ? -1 : shareOf(ghost.body, time));
    });
  }
}
