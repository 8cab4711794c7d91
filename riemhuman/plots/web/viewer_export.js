// Exports: a picture, the surfaces as shown, and a link to the current view.
// Part of one script with the other viewer files.
"use strict";

const PICTURE_SCALE = 2; // pixels of a picture for one of the screen
const GLB = { magic: 0x46546c67, json: 0x4e4f534a, binary: 0x004e4942 };
const GLTF = { float: 5126, integer: 5125, vertices: 34962, indices: 34963 };
const SKIN_ROUGHNESS = 0.62;

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// A file name from the title of the view.
const fileName = (viewer, ending) =>
  `${viewer.element.getAttribute("aria-label").trim().replace(/[^\p{L}\p{N}_.-]+/gu, "_") || "bodies"}.${ending}`;

// The bodies as shown, with their labels, on a transparent ground.
async function picture(viewer) {
  const { renderer, stage } = viewer;
  const ratio = renderer.getPixelRatio();
  renderer.setPixelRatio(PICTURE_SCALE * Math.max(window.devicePixelRatio || 1, 1));
  renderer.render(viewer.scene, viewer.camera);
  const canvas = document.createElement("canvas");
  canvas.width = renderer.domElement.width;
  canvas.height = renderer.domElement.height;
  const context = canvas.getContext("2d");
  context.drawImage(renderer.domElement, 0, 0);
  renderer.setPixelRatio(ratio);
  viewer.draw();
  const box = stage.getBoundingClientRect();
  context.scale(canvas.width / box.width, canvas.height / box.height);
  writeLabels(viewer, context, box);
  return new Promise((done) => { canvas.toBlob(done, "image/png"); });
}

// Draw the labels and their colour bars where they are on the stage.
function writeLabels(viewer, context, box) {
  viewer.find("labels").querySelectorAll(".label").forEach((label) => {
    if (label.style.visibility === "hidden") return;
    label.querySelectorAll("span:not(.scale), i").forEach((part) => {
      const place = part.getBoundingClientRect();
      const left = place.left - box.left;
      const top = place.top - box.top;
      if (part.localName === "i") {
        const colors = part.dataset.colors.split(",");
        const stops = part.dataset.stops.split(",");
        const bar = context.createLinearGradient(left, 0, left + place.width, 0);
        colors.forEach((color, k) => bar.addColorStop(Math.min(1, Math.max(0, Number(stops[k]))), color));
        context.fillStyle = bar;
        context.fillRect(left, top, place.width, place.height);
        return;
      }
      const style = getComputedStyle(part);
      context.font = `${style.fontSize} ${style.fontFamily}`;
      context.fillStyle = style.color;
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillText(part.textContent, left + place.width / 2, top + place.height / 2, place.width + 2);
    });
  });
}

// All bodies beside each other as a binary glTF file, metres, y up, coloured as shown.
function surfacesFile(viewer) {
  const parts = [];
  const document_ = {
    asset: { version: "2.0", generator: "riemhuman" },
    scene: 0,
    scenes: [{ nodes: [] }],
    nodes: [], meshes: [], accessors: [], bufferViews: [], buffers: [], materials: [],
  };
  let length = 0;
  const add = (array, type, target, more = {}) => {
    const [kind, width] = [array instanceof Uint32Array ? GLTF.integer : GLTF.float, type === "VEC3" ? 3 : 1];
    document_.bufferViews.push({ buffer: 0, byteOffset: length, byteLength: array.byteLength, target });
    document_.accessors.push({
      bufferView: document_.bufferViews.length - 1, componentType: kind, count: array.length / width, type, ...more,
    });
    parts.push(array);
    length += array.byteLength;
    return document_.accessors.length - 1;
  };
  const indices = add(viewer.faces, "SCALAR", GLTF.indices);
  let shift = 0;
  viewer.bodies().forEach((body, index) => {
    const { color } = body.geometry.attributes;
    const attributes = {
      POSITION: add(body.positions, "VEC3", GLTF.vertices, rangeOf(body.positions)),
      NORMAL: add(body.normals, "VEC3", GLTF.vertices),
    };
    if (color) attributes.COLOR_0 = add(color.array, "VEC3", GLTF.vertices);
    const base = body.mesh.material.color.toArray();
    document_.materials.push({
      pbrMetallicRoughness: { baseColorFactor: [...base, 1], metallicFactor: 0, roughnessFactor: SKIN_ROUGHNESS },
    });
    document_.meshes.push({ primitives: [{ attributes, indices, material: index }] });
    if (index) shift += (viewer.bodies()[index - 1].wide + body.wide) / 2;
    document_.nodes.push({ name: body.label || `body ${index + 1}`, mesh: index, translation: [shift, body.height / 2, 0] });
    document_.scenes[0].nodes.push(index);
  });
  document_.buffers.push({ byteLength: length });
  return packedFile(document_, parts, length);
}

function rangeOf(positions) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  positions.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  return { min: low, max: high };
}

// The chunks of a GLB file: JSON padded with spaces, then numbers.
function packedFile(document_, parts, length) {
  const bare = new TextEncoder().encode(JSON.stringify(document_));
  const text = new Uint8Array(4 * Math.ceil(bare.length / 4)).fill(0x20);
  text.set(bare);
  const words = (...numbers) => Uint32Array.from(numbers);
  return new Blob([
    words(GLB.magic, 2, 12 + 8 + text.length + 8 + length),
    words(text.length, GLB.json), text,
    words(length, GLB.binary), ...parts,
  ], { type: "model/gltf-binary" });
}

// Camera, choice and time as the fragment of a URL.
function viewOf(viewer) {
  const numbers = [viewer.yaw, viewer.pitch, viewer.zoom, viewer.panX, viewer.panY, viewer.time];
  const pivot = viewer.bodies()[0].pivot;
  const texts = [...numbers.map((number) => String(Number(number.toFixed(4)))), viewer.chosen, pivot ?? ""];
  return `#${viewer.element.id}=${texts.join(",")}`;
}

// Restore the view in the URL if it belongs to this viewer.
async function restore(viewer) {
  const name = `#${viewer.element.id}=`;
  const { hash } = window.location;
  if (!hash.startsWith(name)) return;
  const texts = hash.slice(name.length).split(",");
  const numbers = texts.map(Number);
  if (texts.length !== 8 || !numbers.every(Number.isFinite)) return;
  const [yaw, pitch, zoom, panX, panY, time, chosen, pivot] = numbers;
  if (viewer.data.choices[chosen] && chosen !== viewer.chosen) {
    viewer.element.querySelectorAll('input[type="radio"][value]').forEach((radio) => {
      radio.checked = Number(radio.value) === chosen;
    });
    await viewer.choose(chosen);
  }
  if (texts[7] !== "" && Number.isInteger(pivot) && 3 * pivot < viewer.bodies()[0].positions.length) {
    viewer.bodies().forEach((body) => body.turnAbout(pivot));
  }
  viewer.yaw = yaw;
  viewer.pitch = Math.min(PITCH_LIMIT, Math.max(-PITCH_LIMIT, pitch));
  viewer.zoom = Math.min(ZOOM_LIMITS[1], Math.max(ZOOM_LIMITS[0], zoom));
  viewer.panX = panX;
  viewer.panY = panY;
  viewer.seek(time);
}

// Put the link into the address bar and, if the browser allows it, on the clipboard.
async function link(viewer, button) {
  window.history.replaceState(null, "", viewOf(viewer));
  const copied = navigator.clipboard
    ? navigator.clipboard.writeText(window.location.href).then(() => true, () => false)
    : Promise.resolve(false);
  const name = button.textContent;
  button.textContent = (await copied) ? "Link copied" : "Link in the address bar";
  setTimeout(() => { button.textContent = name; }, 2000);
}

// Notebooks show the page in a frame without an address of its own.
function listenToExports(viewer) {
  const part = viewer.find("exports");
  if (!part) return; // pages stored by earlier releases
  const on = (action, listener) => {
    const button = part.querySelector(`[data-export="${action}"]`);
    button.addEventListener("click", () => listener(button));
    return button;
  };
  on("png", async () => download(await picture(viewer), fileName(viewer, "png")));
  on("glb", () => download(surfacesFile(viewer), fileName(viewer, "glb")));
  on("link", (button) => link(viewer, button)).hidden = !window.location.href.match(/^(https?|file):/);
}
