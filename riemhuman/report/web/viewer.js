// Turns bodies, plays and scrubs paths. Every element of class "viewer" holds its data as JSON.
"use strict";

(() => {
  const SECONDS = 2.4; // one run of a path
  const PITCH_LIMIT = 1.2;
  const TURN = Math.PI / 12; // one press of a key or button

  const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const linear = (value) => Math.pow(value / 255, 2.2);

  // Vertices of one body at all times, and its surface in the scene.
  class Body {
    constructor(data, faces, nVertices) {
      this.label = data.label;
      this.nFrames = data.n_frames;
      this.size = 3 * nVertices;
      this.packed = new Uint16Array(bytes(data.frames).buffer);
      this.low = data.low;
      this.step = data.step;
      this.geometry = new THREE.BufferGeometry();
      this.positions = new Float32Array(this.size);
      this.geometry.setAttribute("position", new THREE.BufferAttribute(this.positions, 3));
      this.geometry.setIndex(new THREE.BufferAttribute(faces, 1));
      const material = new THREE.MeshStandardMaterial({ roughness: 0.82, metalness: 0 });
      if (data.colors) {
        const colors = Float32Array.from(bytes(data.colors), linear);
        this.geometry.setAttribute("color", new THREE.BufferAttribute(colors, 3));
        material.vertexColors = true;
      } else {
        material.color = new THREE.Color(data.color);
      }
      this.turning = new THREE.Group();
      this.turning.add(new THREE.Mesh(this.geometry, material));
      this.holder = new THREE.Group();
      this.holder.add(this.turning);
      this.measure();
      this.show(0);
    }

    // The upright cylinder around the body at all times: its axis is what it turns about.
    measure() {
      const low = [Infinity, Infinity, Infinity];
      const high = [-Infinity, -Infinity, -Infinity];
      for (let i = 0; i < this.packed.length; i += 1) {
        const axis = i % 3;
        const value = this.low[axis] + this.step[axis] * this.packed[i];
        if (value < low[axis]) low[axis] = value;
        if (value > high[axis]) high[axis] = value;
      }
      this.centre = low.map((value, axis) => (value + high[axis]) / 2);
      this.height = high[1] - low[1];
      let square = 0;
      for (let i = 0; i < this.packed.length; i += 3) {
        const x = this.low[0] + this.step[0] * this.packed[i] - this.centre[0];
        const z = this.low[2] + this.step[2] * this.packed[i + 2] - this.centre[2];
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
      this.geometry.attributes.position.needsUpdate = true;
      this.geometry.computeVertexNormals();
      this.geometry.computeBoundingSphere();
    }
  }

  class Viewer {
    constructor(element) {
      this.element = element;
      this.find = (name) => element.querySelector(`[data-part="${name}"]`);
      const data = JSON.parse(this.find("data").textContent);
      const raw = bytes(data.faces).buffer;
      this.faces = data.n_vertices > 65535 ? new Uint32Array(raw) : new Uint16Array(raw);
      this.data = data;
      this.chosen = 0;
      this.time = 0;
      this.yaw = this.startYaw = (-data.azimuth * Math.PI) / 180;
      this.pitch = this.startPitch = (data.elevation * Math.PI) / 180;
      this.zoom = 1;
      this.built = [];
      this.playing = 0;
      this.stage = this.find("stage");
      this.canvas = this.find("canvas");
      try {
        this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, alpha: true, antialias: true });
      } catch {
        this.stage.hidden = true;
        this.find("controls").hidden = true;
        this.find("message").hidden = false;
        return;
      }
      this.scene = new THREE.Scene();
      this.camera = new THREE.PerspectiveCamera(8, 1, 0.1, 400);
      this.scene.add(new THREE.HemisphereLight(0xffffff, 0x6a6560, 1.15));
      const key = new THREE.DirectionalLight(0xffffff, 2.1);
      key.position.set(-0.45, 0.65, 0.61);
      const fill = new THREE.DirectionalLight(0xffffff, 0.7);
      fill.position.set(0.8, 0.1, 0.59);
      this.scene.add(key, fill);
      this.listen();
      this.choose(0);
      new ResizeObserver(() => this.resize()).observe(this.stage);
      element.dataset.ready = "true";
    }

    bodies(index) {
      if (!this.built[index]) {
        this.built[index] = this.data.choices[index].bodies.map(
          (body) => new Body(body, this.faces, this.data.n_vertices),
        );
      }
      return this.built[index];
    }

    listen() {
      const slider = this.find("time");
      slider.addEventListener("input", () => {
        this.pause();
        this.seek(Number(slider.value) / Number(slider.max));
      });
      this.find("play").addEventListener("click", () => (this.playing ? this.pause() : this.play()));
      this.element.querySelectorAll('input[type="radio"]').forEach((radio) => {
        radio.addEventListener("change", () => this.choose(Number(radio.value)));
      });
      const actions = {
        left: () => this.turn(-TURN, 0),
        right: () => this.turn(TURN, 0),
        up: () => this.turn(0, TURN),
        down: () => this.turn(0, -TURN),
        closer: () => this.magnify(1.2),
        farther: () => this.magnify(1 / 1.2),
        reset: () => this.reset(),
      };
      this.element.querySelectorAll("button[data-action]").forEach((button) => {
        button.addEventListener("click", actions[button.dataset.action]);
      });
      const keys = {
        ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down",
        "+": "closer", "=": "closer", "-": "farther", Home: "reset",
      };
      this.canvas.addEventListener("keydown", (event) => {
        const action = keys[event.key];
        if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        actions[action]();
      });
      let last = null;
      this.canvas.addEventListener("pointerdown", (event) => {
        last = event;
        this.canvas.setPointerCapture(event.pointerId);
      });
      this.canvas.addEventListener("pointermove", (event) => {
        if (!last || event.pointerId !== last.pointerId) return;
        this.turn((event.clientX - last.clientX) / 120, (event.clientY - last.clientY) / 200);
        last = event;
      });
      ["pointerup", "pointercancel"].forEach((name) =>
        this.canvas.addEventListener(name, () => { last = null; }),
      );
    }

    choose(index) {
      this.bodies(this.chosen).forEach((body) => this.scene.remove(body.holder));
      this.chosen = index;
      const bodies = this.bodies(index);
      bodies.forEach((body) => this.scene.add(body.holder));
      const moving = bodies.some((body) => body.nFrames > 1);
      this.find("running").hidden = !moving;
      if (!moving) this.pause();
      this.element.dataset.choice = this.data.choices[index].name;
      const labels = this.find("labels");
      labels.replaceChildren(
        ...bodies.map((body) => {
          const label = document.createElement("span");
          label.className = "label";
          label.textContent = body.label;
          return label;
        }),
      );
      this.seek(this.time);
      this.resize();
    }

    seek(time) {
      this.time = Math.min(1, Math.max(0, time));
      const slider = this.find("time");
      slider.value = String(Math.round(this.time * Number(slider.max)));
      this.find("moment").textContent = this.time.toFixed(2);
      this.element.dataset.time = this.time.toFixed(3);
      this.bodies(this.chosen).forEach((body) => body.show(this.time));
      this.draw();
    }

    play() {
      if (this.time >= 1) this.seek(0);
      const began = performance.now() - this.time * SECONDS * 1000;
      const advance = (now) => {
        const time = (now - began) / (SECONDS * 1000);
        this.seek(time);
        if (time >= 1) this.pause();
        else this.playing = requestAnimationFrame(advance);
      };
      this.playing = requestAnimationFrame(advance);
      this.find("play").textContent = "Pause";
    }

    pause() {
      cancelAnimationFrame(this.playing);
      this.playing = 0;
      this.find("play").textContent = "Play";
    }

    turn(yaw, pitch) {
      this.yaw += yaw;
      this.pitch = Math.min(PITCH_LIMIT, Math.max(-PITCH_LIMIT, this.pitch + pitch));
      this.element.dataset.yaw = this.yaw.toFixed(3);
      this.draw();
    }

    magnify(factor) {
      this.zoom = Math.min(6, Math.max(0.5, this.zoom * factor));
      this.draw();
    }

    reset() {
      this.yaw = this.startYaw;
      this.pitch = this.startPitch;
      this.zoom = 1;
      this.draw();
    }

    resize() {
      const width = this.stage.clientWidth;
      const height = this.stage.clientHeight;
      if (!width || !height) return;
      this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.arrange(width / height);
      this.draw();
    }

    // As many columns as let the bodies appear largest.
    arrange(aspect) {
      const bodies = this.bodies(this.chosen);
      const wide = 2 * Math.max(...bodies.map((body) => body.radius)) * 0.94;
      const tall = 1.2 * Math.max(...bodies.map((body) => body.height));
      let best = { extent: Infinity };
      for (let columns = 1; columns <= bodies.length; columns += 1) {
        const rows = Math.ceil(bodies.length / columns);
        const extent = Math.max(rows * tall, (columns * wide) / aspect);
        if (extent < best.extent) best = { extent, columns, rows };
      }
      const tallest = Math.max(...bodies.map((body) => body.height));
      this.extent = best.extent;
      this.below = tall / 2;
      bodies.forEach((body, index) => {
        const row = Math.floor(index / best.columns);
        const inRow = Math.min(best.columns, bodies.length - row * best.columns);
        body.holder.position.set(
          ((index % best.columns) - (inRow - 1) / 2) * wide,
          ((best.rows - 1) / 2 - row) * tall + 0.07 * tall,
          0,
        );
        // All stand on one floor.
        body.holder.position.y -= (tallest - body.height) / 2;
        body.floor = body.holder.position.y + (tallest - body.height) / 2 - this.below * 0.87;
      });
    }

    draw() {
      if (!this.extent) return;
      const half = Math.tan((this.camera.fov * Math.PI) / 360);
      this.camera.position.set(0, 0, this.extent / 2 / half / this.zoom + 0.5);
      this.camera.updateProjectionMatrix();
      const bodies = this.bodies(this.chosen);
      bodies.forEach((body) => {
        body.holder.rotation.x = this.pitch;
        body.turning.rotation.y = this.yaw;
      });
      this.renderer.render(this.scene, this.camera);
      const scale = (this.stage.clientHeight / this.extent) * this.zoom;
      const labels = this.find("labels").children;
      bodies.forEach((body, index) => {
        const { x } = body.holder.position;
        labels[index].style.left = `${this.stage.clientWidth / 2 + x * scale}px`;
        labels[index].style.top =
          `${this.stage.clientHeight / 2 - body.floor * scale}px`;
      });
    }
  }

  // Started when near the window, so that the page is there at once.
  const observer = new IntersectionObserver(
    (entries) => {
      entries.filter((entry) => entry.isIntersecting).forEach((entry) => {
        observer.unobserve(entry.target);
        new Viewer(entry.target);
      });
    },
    { rootMargin: "200px" },
  );
  document.querySelectorAll(".viewer").forEach((element) => observer.observe(element));
})();
