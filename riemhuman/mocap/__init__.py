"""Motion capture: motions, the files that hold them, and bodies that move as recorded people did.

`riemhuman.datasets` has the public names. `motions` are sequences of bodies. Each kind of file has
a module: `bvh`, `amc`, `markers` (TRC and C3D), `amass`, `motion_arrays`; `recordings` reads any.
`retargeting` lets a body perform a recorded skeleton, in these stages:

- joints are recognised by name, or by the shape of the tree (`_joint_names`, `_joint_tree`);
- the axis that points up is found, and when feet stand (`_upward`, `_recorded_skeletons`);
- the axes of joints are found from positions, whatever the axes of the file (`_joint_axes`);
- limbs, trunk and neck follow the recorded directions (`_limbs`);
- the body moves so that standing feet are where they were recorded, and limbs leave the recorded
  directions by a few degrees so that feet that stand still stay in place; nothing is more than 5 mm
  below the floor (`_standing`).

Lengths are scaled by those of the legs, or the body is (`_units`, `_body_size`). `performances`
runs all stages.
"""
