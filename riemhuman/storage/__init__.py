"""Files that appear whole or not at all, locks, checksums, and fingerprints of inputs.

Two stores share locks, fingerprints and files of arrays. `ResultStore` keeps the result of each
step in a compressed file, which it replaces as a whole when the inputs of the step have changed.
`JobFolder` fills tables that may be larger than memory entry by entry, and refuses to continue
another job.

Libraries that were tried and are not used:

* Zarr 3.1 reserves no disk space in advance, reads a lost chunk as zeros and a flipped bit as
  another number, and installs 45 MB. Tables of jobs are single .npy files, allocated in full, so
  that a disk that is too small is found at once.
* safetensors 0.8 replaces files as a whole, but refuses text and complex numbers, and permutes the
  entries of arrays in Fortran order. Named arrays are .npz files.
* filelock 4.2 leaves its lock files behind and locks files that are not its own.
* platformdirs names the folders of a user, in which the library keeps nothing.
"""
