// Panels: drawings on bodies, with controls beside them; a class for each kind, by its name.
// Part of one script with the other viewer files.
"use strict";

const PANELS = {};

// The base class, used by pages without a panel.
class Panel {
  static async of(viewer) {
    const { panel } = viewer.data;
    if (!panel) return new Panel(viewer);
    const ownPanel = new PANELS[panel.name](viewer);
    await ownPanel.prepare(panel);
    return ownPanel;
  }

  constructor(viewer) {
    this.viewer = viewer;
    this.part = viewer.find("panel");
    this.isOnSurface = false; // what is drawn close to the triangles needs them as they are
  }

  async prepare() {}

  // Called when bodies are shown, which can then be drawn on.
  choose() {}

  // Called when another moment is shown.
  seek() {}

  // The text for a place of the stage. `hit` is the body there, or null, and `text` describes it.
  describe(place, hit, text) {
    return text;
  }

  // Called when the pointer leaves the bodies.
  leave() {}
}
