// Bodies to turn, paths to play. Every element of class "viewer" holds its data as JSON.
// Part of one script with the other viewer files; README.md says how they are joined.
"use strict";

const PITCH_LIMIT = 1.5;
const ZOOM_LIMITS = [0.5, 60];
const ROOM = { above: 0.03, ground: 0.09, names: 0.15, smallNames: 0.27 }; // shares of the tallest body
const MANY = 16; // bodies with smaller names, in at most two lines
const NARROWEST_NAME = 50; // pixels between many bodies; nearer ones show their names after zooming in
const LABEL_GAP = 0.045; // between the feet and the name below, a share of the tallest body
const FRAMED = 0.22; // height of the part that fills the stage after a double click, likewise
const STILL = 150; // milliseconds without a change before a processor draws at full quality

// Whether there is no graphics card: smooth outlines would then take longer than everything else.
function drawsOnProcessor() {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return false;
  const info = context.getExtension("WEBGL_debug_renderer_info");
  const name = context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  const release = context.getExtension("WEBGL_lose_context");
  if (release) release.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

class Viewer {
  constructor(element) {
    this.element = element;
    element.viewer = this;
    this.find = (name) => element.querySelector(`[data-part="${name}"]`);
    const data = JSON.parse(this.find("data").textContent);
    this.data = data;
    this.chosen = 0;
    this.time = 0;
    this.startYaw = (-data.azimuth * Math.PI) / 180;
    this.startPitch = (data.elevation * Math.PI) / 180;
    this.toStart();
    this.built = [];
    this.playing = 0;
    this.stage = this.find("stage");
    this.canvas = this.find("canvas");
    if (!this.setUpRenderer()) {
      this.beStill();
      return;
    }
    this.canvas.addEventListener("webglcontextlost", () => this.beStill());
    this.start();
  }

  async start() {
    this.faces = await unpack(this.data.faces, Uint32Array, 3);
    const { parts, shade, eyes } = this.data;
    this.skin = { shade: shade && await inflate(shade), eyes: await unpackEyes(eyes) };
    if (parts) this.parts = { names: parts.names, numbers: await inflate(parts.numbers) };
    this.sliders = new Sliders(this);
    this.bars = new ValueBars(this);
    this.trail = new Trail(this);
    this.panel = await Panel.of(this);
    await this.choose(0);
    listen(this);
    listenToExports(this);
    DARK.addEventListener("change", () => {
      this.built.forEach((bodies) => bodies.forEach((body) => body.ground.ink()));
      this.draw();
    });
    new ResizeObserver(() => this.resize()).observe(this.stage);
    await restore(this);
    this.element.dataset.ready = "true";
  }

  // Set up the renderer; return whether the browser supports it.
  setUpRenderer() {
    this.slow = drawsOnProcessor();
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, alpha: true, antialias: !this.slow });
    } catch {
      return false;
    }
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(8, 1, 0.1, 400);
    this.ray = new THREE.Raycaster();
    const { sky, ground, strength } = LIGHT.hemisphere;
    const color = (channels) => new THREE.Color().fromArray(channels);
    this.scene.add(new THREE.HemisphereLight(color(sky), color(ground), strength));
    LIGHT.lights.forEach((each) => {
      const light = new THREE.DirectionalLight(color(each.color), each.strength);
      light.position.fromArray(each.towards);
      this.scene.add(light);
    });
    return true;
  }

  // Show pictures instead of bodies that turn; the choices still work.
  beStill() {
    this.pause();
    delete this.element.dataset.ready;
    this.element.dataset.still = "true";
    ["running", "turning", "exports", "lines", "help", "labels", "hint", "components", "panel"].forEach((name) => {
      const part = this.find(name);
      if (part) part.hidden = true;
    });
    this.find("message").hidden = false;
    const stills = this.element.querySelectorAll(".still");
    const show = (index) => stills.forEach((still, i) => { still.hidden = i !== index; });
    this.element.querySelectorAll('input[type="radio"]').forEach((radio) => {
      radio.addEventListener("change", () => show(Number(radio.value)));
    });
    show(this.chosen);
  }

  bodies() {
    return this.built[this.chosen] || [];
  }

  async choose(index) {
    this.wanted = index;
    if (!this.built[index]) {
      const skin = { ...this.skin, flat: this.panel.isOnSurface };
      this.built[index] = await Promise.all(this.data.choices[index].bodies.map(
        (body) => Body.from(body, this.faces, this.data.n_vertices, skin),
      ));
    }
    if (this.wanted !== index) return; // something else was chosen in the meantime
    const pivot = this.bodies()[0].pivot;
    this.bodies().forEach((body) => this.scene.remove(body.holder));
    this.chosen = index;
    const bodies = this.bodies();
    bodies.forEach((body) => {
      body.turnAbout(pivot);
      this.scene.add(body.holder);
    });
    const moving = bodies.some((body) => body.nFrames > 1);
    this.find("running").hidden = !moving;
    if (!moving) this.pause();
    // Makes the arrow keys step from frame to frame.
    if (moving && this.isRecorded()) this.find("time").max = String(this.lastFrame());
    this.sliders.choose(bodies);
    this.bars.choose(bodies);
    this.trail.choose(bodies);
    this.element.dataset.choice = this.data.choices[index].name;
    // Labels make the colours of values, over which panels draw.
    this.find("labels").replaceChildren(...bodies.map((body) => this.label(body)));
    this.panel.choose(bodies);
    this.hideHint();
    this.seek(this.time);
    this.resize();
  }

  // The name of a body and, if it is coloured by values, their scale.
  label(body) {
    const label = document.createElement("div");
    label.className = this.bodies().length > MANY ? "label small" : "label";
    const write = (parent, kind, text = "") => {
      const part = document.createElement(kind);
      part.textContent = text;
      parent.append(part);
      return part;
    };
    // Let names of files break at underscores first.
    if (body.label) write(label, "span", body.label.replaceAll("_", "_\u200b"));
    if (body.values) this.bars.write(body, label);
    return label;
  }

  seek(time) {
    this.time = Math.min(1, Math.max(0, time));
    const slider = this.find("time");
    slider.value = String(Math.round(this.time * Number(slider.max)));
    this.writeTime(slider);
    this.element.dataset.time = this.time.toFixed(3);
    const last = this.lastFrame();
    // Recordings keep their speed: the shorter one waits in its last frame.
    const shareOf = (body, share) =>
      this.isRecorded() ? Math.min(1, (share * last) / Math.max(body.nTimes - 1, 1)) : share;
    this.bodies().forEach((body) => body.show(shareOf(body, this.time)));
    this.trail.seek(shareOf);
    this.panel.seek();
    this.draw();
  }

  // Whether time is in seconds of a recording rather than a share of a path.
  isRecorded() {
    return Boolean(this.data.frames_per_second);
  }

  lastFrame() {
    return Math.max(...this.bodies().map((body) => body.nTimes)) - 1;
  }

  // Seconds at speed 1.
  duration() {
    return this.isRecorded() ? this.lastFrame() / this.data.frames_per_second : this.data.seconds;
  }

  // Write the time beside the slider, and for screen readers; frames are counted from 1.
  writeTime(slider) {
    let text = `t = ${this.time.toFixed(2)}`;
    let spoken = `${Math.round(100 * this.time)} % of the path`;
    if (this.isRecorded()) {
      const duration = this.duration();
      const seconds = (this.time * duration).toFixed(2);
      const count = `frame ${Math.round(this.time * this.lastFrame()) + 1} of ${this.lastFrame() + 1}`;
      text = `${seconds} s of ${duration.toFixed(2)} s, ${count}`;
      spoken = `${seconds} seconds, ${count}`;
    }
    this.find("moment").textContent = text;
    slider.setAttribute("aria-valuetext", spoken);
  }

  toggle() {
    if (this.find("running").hidden) return;
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.time >= 1) this.seek(0);
    let before = performance.now();
    let count = { since: before, frames: 0 };
    const advance = (now) => {
      count.frames += 1;
      if (now - count.since >= 1000) {
        this.element.dataset.rate = ((1000 * count.frames) / (now - count.since)).toFixed(1);
        count = { since: now, frames: 0 };
      }
      const passed = ((now - before) / (this.duration() * 1000)) * Number(this.find("speed").value);
      before = now;
      const time = this.time + Math.max(passed, 0);
      if (time < 1) this.seek(time);
      else if (this.find("loop").checked) this.seek(time % 1);
      else this.seek(1);
      if (this.time >= 1) this.pause();
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
    this.draw();
  }

  // Metres per pixel at the distance of the bodies.
  metresPerPixel() {
    const half = Math.tan((this.camera.fov * Math.PI) / 360);
    return (2 * half * this.distance) / this.zoom / this.stage.clientHeight;
  }

  move(right, below) {
    this.panX -= right * this.metresPerPixel();
    this.panY += below * this.metresPerPixel();
    this.draw();
  }

  // Zoom around a fixed place of the stage.
  magnify(factor, place = this.middle()) {
    const right = place.x - this.stage.clientWidth / 2;
    const below = place.y - this.stage.clientHeight / 2;
    const before = this.metresPerPixel();
    this.zoom = Math.min(ZOOM_LIMITS[1], Math.max(ZOOM_LIMITS[0], this.zoom * factor));
    const less = before - this.metresPerPixel();
    this.panX += right * less;
    this.panY -= below * less;
    this.draw();
  }

  middle() {
    return { x: this.stage.clientWidth / 2, y: this.stage.clientHeight / 2 };
  }

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  // The nearest body at a place of the stage, with the triangle and its nearest corner.
  hit(place) {
    const { x, y } = this.middle();
    this.ray.setFromCamera(new THREE.Vector2(place.x / x - 1, 1 - place.y / y), this.camera);
    const bodies = this.bodies();
    const [nearest] = this.ray.intersectObjects(bodies.map((body) => body.mesh), false);
    if (!nearest) return null;
    const body = bodies.find((each) => each.mesh === nearest.object);
    const point = body.mesh.worldToLocal(nearest.point.clone()).toArray();
    const gap = (vertex) =>
      Math.hypot(...point.map((value, axis) => value - body.positions[3 * vertex + axis]));
    const face = body.smooth ? body.smooth.faceOf(nearest.faceIndex) : nearest.faceIndex;
    const corners = body.faces.slice(3 * face, 3 * face + 3);
    const vertex = corners.reduce((best, each) => (gap(each) < gap(best) ? each : best));
    return { body, face, vertex };
  }

  // Show what the pointer is on.
  point(place) {
    const hit = this.hit(place);
    const hint = this.find("hint");
    const part = hit && this.parts ? this.parts.names[this.parts.numbers[hit.face]] || "" : "";
    const ofBody = hit ? hit.body.describe(hit, this.data.choices[this.chosen].name, part) : "";
    const text = this.panel.describe(place, hit, ofBody);
    hint.hidden = !text;
    hint.textContent = text;
    if (!text) return;
    hint.style.left = this.within(place.x + 12, hint.offsetWidth, this.stage.clientWidth);
    hint.style.top = this.within(place.y - 12 - hint.offsetHeight, hint.offsetHeight, this.stage.clientHeight);
  }

  hideHint() {
    this.find("hint").hidden = true;
    this.panel.leave();
  }

  // Where something of this length starts, so that it is within the whole. The browser rounds
  // lengths to whole pixels, hence the one to spare.
  within(start, length, whole) {
    return `${Math.max(0, Math.min(start, whole - length - 1))}px`;
  }

  // Centre the view on a point of a body and turn all bodies about it; beside the bodies, reset.
  frame(place) {
    const hit = this.hit(place);
    if (!hit) {
      this.reset();
      return;
    }
    this.bodies().forEach((body) => body.turnAbout(hit.vertex));
    this.panX = hit.body.holder.position.x;
    this.panY = hit.body.holder.position.y;
    const tallest = Math.max(...this.bodies().map((body) => body.height));
    this.zoom = Math.max(this.zoom, Math.min(ZOOM_LIMITS[1], this.extent / (FRAMED * tallest)));
    this.draw();
  }

  toStart() {
    this.yaw = this.startYaw;
    this.pitch = this.startPitch;
    this.zoom = 1;
    this.panX = 0;
    this.panY = 0;
  }

  reset() {
    this.toStart();
    this.bodies().forEach((body) => body.turnAbout(null));
    this.draw();
  }

  resize() {
    const width = this.stage.clientWidth;
    const height = this.stage.clientHeight;
    if (!width || !height) return;
    this.setFineness(1);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.arrange(width / height);
    this.draw();
  }

  // Choose the number of columns that shows the bodies largest. In a single row, each body has its
  // own width; in several, all have that of the widest.
  arrange(aspect) {
    const bodies = this.bodies();
    const widths = bodies.map((body) => 2 * body.radius);
    const widest = Math.max(...widths);
    const inOneRow = widths.reduce((sum, width) => sum + width, 0);
    const tallest = Math.max(...bodies.map((body) => body.height));
    // Leave room below the feet for the ground and for names.
    const named = bodies.length > MANY ? ROOM.smallNames : ROOM.names;
    const room = bodies.some((body) => body.label || body.values) ? named : ROOM.ground;
    const tall = (1 + ROOM.above + room) * tallest;
    let best = { extent: Infinity };
    for (let columns = 1; columns <= bodies.length; columns += 1) {
      const rows = Math.ceil(bodies.length / columns);
      const extent = Math.max(rows * tall, (rows === 1 ? inOneRow : columns * widest) / aspect);
      if (extent < best.extent) best = { extent, columns, rows };
    }
    this.extent = best.extent;
    this.distance = this.extent / 2 / Math.tan((this.camera.fov * Math.PI) / 360) + 0.5;
    this.cell = { tall };
    let left = -inOneRow / 2;
    bodies.forEach((body, index) => {
      const row = Math.floor(index / best.columns);
      const inRow = Math.min(best.columns, bodies.length - row * best.columns);
      body.wide = best.rows === 1 ? widths[index] : widest;
      const across = best.rows === 1
        ? left + body.wide / 2
        : ((index % best.columns) - (inRow - 1) / 2) * widest;
      left += body.wide;
      // All bodies stand on one floor.
      const floor = ((best.rows - 1) / 2 - row - 0.5) * tall + room * tallest;
      body.holder.position.set(across, floor - body.floor, 0);
      body.labelled = floor - LABEL_GAP * tallest;
    });
  }

  draw() {
    if (!this.extent) return;
    this.camera.position.set(this.panX, this.panY, this.distance);
    this.camera.zoom = this.zoom;
    this.camera.updateProjectionMatrix();
    this.bodies().forEach((body) => {
      body.holder.rotation.x = this.pitch;
      body.turning.rotation.y = this.yaw;
    });
    this.render();
    this.placeLabels();
    const { dataset } = this.element;
    Object.assign(dataset, {
      yaw: this.yaw.toFixed(3), zoom: this.zoom.toFixed(3),
      panX: this.panX.toFixed(4), panY: this.panY.toFixed(4), // metres
      scale: (1 / this.metresPerPixel()).toFixed(2), // pixels a metre
    });
    // Unless zoomed in, a finger that moves up or down scrolls the page.
    this.canvas.style.touchAction = this.zoom > 1.01 ? "none" : "pan-y";
  }

  // Draw this many pixels for each of the screen, in each direction.
  setFineness(times) {
    const ratio = times * Math.min(window.devicePixelRatio || 1, 2);
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
  }

  // Without a graphics card, outlines are smooth only while nothing moves.
  render() {
    if (this.slow) {
      clearTimeout(this.waiting);
      this.setFineness(1);
      this.waiting = setTimeout(() => {
        this.setFineness(2);
        this.renderer.render(this.scene, this.camera);
        this.element.dataset.fine = "true";
      }, STILL);
    }
    this.renderer.render(this.scene, this.camera);
    this.element.dataset.fine = String(!this.slow);
  }

  // Place labels below the visible bodies, within the stage.
  placeLabels() {
    const { clientWidth, clientHeight } = this.stage;
    const scale = 1 / this.metresPerPixel();
    const labels = this.find("labels").children;
    this.bodies().forEach((body, index) => {
      const label = labels[index];
      const x = clientWidth / 2 + (body.holder.position.x - this.panX) * scale;
      const y = clientHeight / 2 - (body.labelled - this.panY) * scale;
      const isAside = Math.abs(x - clientWidth / 2) > clientWidth / 2 + (body.wide / 2) * scale;
      const fits = this.bodies().length <= MANY || body.wide * scale > NARROWEST_NAME;
      const isVisible = fits && !isAside && y > 0 && y - this.cell.tall * scale < clientHeight;
      label.style.visibility = isVisible ? "" : "hidden";
      label.style.maxWidth = `${Math.min(clientWidth, Math.max(60, body.wide * scale - 6))}px`;
      label.style.left = this.within(x - label.offsetWidth / 2, label.offsetWidth, clientWidth);
      label.style.top = this.within(y, label.offsetHeight, clientHeight);
    });
  }
}

// Viewers start when they come near the window, so that the page appears at once.
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
