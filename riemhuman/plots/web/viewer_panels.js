// What is drawn on bodies, with controls beside them: a class for each kind, by its name.
// Part of one script with the other viewer files.
"use strict";

const PANELS = {};

// The panel of a page without one; others extend it.
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

  // Bodies are shown, in which more can be drawn.
  choose() {}

  // Another moment is shown.
  seek() {}

  // What to say of a place of the stage, where a body was hit or not.
  describe(place, found, said) {
    return said;
  }

  // The pointer has left the bodies.
  leave() {}
}
