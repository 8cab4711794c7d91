"""Motion capture performed by bodies: recordings of skeletons become poses of a body model.

`riemhuman.datasets.retarget` is the public function. A recording goes through these stages, each in
a module of its own:

- joints are recognised by name, or by the shape of the tree (`joint_names`, `_joint_tree`);
- the axis that points up is found, and when feet stand (`upward`, `_recorded_skeletons`);
- the axes of joints are found from positions, whatever the axes of the file (`joint_axes`);
- limbs, trunk and neck follow the recorded directions (`_limbs`);
- the body moves so that standing feet are where they were recorded, and limbs leave the recorded
  directions by a few degrees so that feet that stand still stay in place; nothing is more than 5 mm
  below the floor (`_standing`).

Lengths are scaled by those of the legs, or the body is (`units`, `body_size`). `performances` runs
all stages.
"""
