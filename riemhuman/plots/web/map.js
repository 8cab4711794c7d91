// A map beside a body: pointing at a dot shows its body.
// Part of one script with the other viewer files.
"use strict";

class BodyMap extends Panel {
  async prepare({ items }) {
    this.items = items;
    this.shown = 0;
    this.dots = [...this.part.querySelectorAll("[data-item]")];
    const show = (event) => this.show(Number(event.target.dataset.item));
    this.dots.forEach((dot) => {
      ["pointerenter", "focus", "click"].forEach((kind) => dot.addEventListener(kind, show));
    });
  }

  // The bodies are frames of a path that is never played.
  choose() {
    this.viewer.find("running").hidden = true;
    this.viewer.pause();
    this.show(this.shown);
  }

  show(item) {
    this.shown = item;
    const [name, color] = this.items[item];
    const [body] = this.viewer.bodies();
    this.dots.forEach((dot, number) => dot.classList.toggle("shown", number === item));
    body.label = name;
    body.mesh.material.color.set(color).lerp(new THREE.Color("#d8cdc0"), 0.45);
    const label = this.viewer.find("labels").querySelector("span");
    if (label) label.textContent = name.replaceAll("_", "_\u200b");
    this.part.querySelector("[data-part=map]").dataset.shown = String(item);
    this.viewer.hideHint();
    this.viewer.seek(item / Math.max(this.items.length - 1, 1));
  }
}
PANELS.map = BodyMap;
