"""Files: written whole or not at all, locked, checked, and known by what they were made of.

Two stores share locks, fingerprints and whole files. `ResultStore` keeps finished steps, and those
are computed anew whose inputs changed; `JobFolder` fills tables larger than memory in place, and
refuses another job. Neither can do the other's work.

Why not the libraries of the field, as tried:

* Zarr 3.1 takes no room before the work begins, reads a lost chunk as zeros and a flipped bit as
  another number, and brings 45 MB. Tables of jobs are single .npy files, laid out in full, so that
  a disk that is too small shows at once.
* safetensors 0.8 replaces files whole, but refuses text and complex numbers, and gives arrays in
  Fortran order back with their entries in other places. Named arrays are .npz files.
* filelock 4.2 leaves its files behind and locks files that are not its own.
* platformdirs names folders of the user's system, in which nothing is kept.
"""
