#!/usr/bin/env python3
"""Writes the .mat and .h5 files of this folder: scipy.io writes MAT 5, h5py writes HDF5."""
import h5py
import numpy as np
import scipy.io

ROWS, COLUMNS, HEIGHT, WIDTH = 2, 3, 6, 8
t, s, v, u, c = np.indices((ROWS, COLUMNS, HEIGHT, WIDTH, 3))
LEVELS = (17 * t + 29 * s + 5 * v + 3 * u + 11 * c).astype(np.uint8)


def with_weights(values, white):
    """A fourth channel, 0 in the view of row 0, column 2."""
    weights = np.full(values.shape[:4] + (1,), white, values.dtype)
    weights[0, 2] = 0
    return np.concatenate([values, weights], axis=4)


def mark(item, name):
    """The attribute MATLAB_class as Matlab writes it: text that ends with the last byte."""
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(name))
    attribute = h5py.h5a.create(item.id, b"MATLAB_class", kind, h5py.h5s.create(h5py.h5s.SCALAR))
    attribute.write(np.array(name.encode(), dtype="S%d" % len(name)), mtype=kind)


def write_mat_73(path, values, tasks):
    with h5py.File(path, "w", userblock_size=512) as file:
        array = file.create_dataset("LF", data=values.T, chunks=(1, 4, 3, 3, 2),
                                    compression="gzip", shuffle=True)
        mark(array, str(values.dtype))
        options = file.create_group("DecodeOptions")
        mark(options, "struct")
        if tasks:
            texts = file.create_group("#refs#")
            references = []
            for i, task in enumerate(tasks):
                text = texts.create_dataset("abc"[i], data=np.array([[ord(x)] for x in task], np.uint16))
                mark(text, "char")
                references.append(text.ref)
            cell = options.create_dataset("OptionalTasks", (len(tasks), 1), dtype=h5py.ref_dtype)
            cell[:, 0] = references
        else:
            cell = options.create_dataset("OptionalTasks", data=np.zeros(2, np.uint64))
            cell.attrs["MATLAB_empty"] = np.uint8(1)
        mark(cell, "cell")
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Fri Nov 27 2026 HDF5 schema 1.00 ."
    with open(path, "r+b") as file:
        file.write(header.ljust(116) + bytes(8) + b"\x00\x02IM")


scipy.io.savemat("levels-5.mat", {"LF": LEVELS}, do_compression=False)
scipy.io.savemat(
    "corrected-5-compressed.mat",
    {"before": np.arange(6.0), "LF": with_weights(LEVELS.astype(np.float32) / 255, 1),
     "DecodeOptions": {"Gamma": 0.4166, "OptionalTasks": np.array(["ColourCorrect"], dtype=object)}},
    do_compression=True)
scipy.io.savemat("signed-5.mat", {"LF": LEVELS.astype(np.int16)}, do_compression=True)
scipy.io.savemat("image-5.mat", {"image": LEVELS[0, 0]}, do_compression=True)
write_mat_73("linear-7.3.mat", with_weights(LEVELS.astype(np.uint16) * 257, 65535), [])
write_mat_73("corrected-7.3.mat", LEVELS, ["ColourCorrect", "Rectify"])
with h5py.File("heidelberg.h5", "w") as file:
    file.create_dataset("LF", data=LEVELS)
    file.create_dataset("GT_DEPTH", data=np.ones((ROWS, COLUMNS, HEIGHT, WIDTH), np.float32))
    for name, value in dict(dH=0.1, focalLength=9.375, shift=1.5, vRes=ROWS, hRes=COLUMNS,
                            yRes=HEIGHT, xRes=WIDTH, channels=3).items():
        file.attrs[name] = value

# Data sets whose numbers are in other files: nobody chose those.
with h5py.File("external.h5", "w") as file:
    file.create_dataset("LF", (3, 3, 4, 5, 3), dtype="u1", external=[("elsewhere.bin", 0, 540)])
with h5py.File("virtual.h5", "w") as file:
    source = h5py.VirtualSource("elsewhere.h5", "LF", shape=(3, 3, 4, 5, 3), maxshape=(None, 3, 4, 5, 3))
    layout = h5py.VirtualLayout(shape=(3, 3, 4, 5, 3), dtype="u1", maxshape=(None, 3, 4, 5, 3))
    layout[0:h5py.h5s.UNLIMITED:1] = source[0:h5py.h5s.UNLIMITED:1]
    file.create_virtual_dataset("LF", layout)

# Views in one axis, row by row.
with h5py.File("numbered.h5", "w") as file:
    file.create_dataset("LF", data=LEVELS.reshape(ROWS * COLUMNS, HEIGHT, WIDTH, 3))
scipy.io.savemat("numbered-5.mat", {"LF": LEVELS.reshape(ROWS * COLUMNS, HEIGHT, WIDTH, 3)},
                 do_compression=True)
