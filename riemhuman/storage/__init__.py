"""Files: written whole or not at all, locked, checked, and known by what they were made of.

Named arrays are .npz files because NumPy alone reads them, and because they hold text, which
safetensors does not. Tables of jobs are single .npy files, laid out in full before the work begins,
so that a disk that is too small shows at once; Zarr writes its chunks one by one. Locks are our own
because filelock empties whatever has the name of its file. Nothing is kept in folders of the
user's system, so platformdirs has no use here.
"""
