// Panels: drawings on bodies, with controls beside them; a class for each kind, by its name.
// Part of one script with the other viewer files.
"use strict";

const PANELS = {};

// The base class, used by pages without a panel.
class Panel {
  static async of(viewer) {
    const { panel } = viewer.data;
    if (!panel) return new Panel(viewer);
    const made = new PANELS[panel.name](viewer);
    await made.prepare(panel);
    return made;
  }

  constructor(viewer) {
    this.viewer = viewer;
    this.part = viewer.find("panel");
  }

  async prepare() {}

  // Called when bodies are shown, which can then be drawn on.
  choose() {}

  // Called when another moment is shown.
  seek() {}

  // The text for a place of the stage, whether or not a body was hit.
  describe(place, found, said) {
    return said;
  }

  // Called when the pointer leaves the bodies.
  leave() {}
}
