"""Reads two PLY files with other programs, an augmented scene and its base alone: readers.py AUGMENTED BASE USDA. Each program must get
the same data from both. The third file is the base in OpenUSD, which usd-core must read. Run by tools/readers, which installs the packages."""

import sys

import numpy
import open3d
import pymeshlab
from pxr import Usd


def open3d_reads(path):
    point = open3d.t.io.read_point_cloud(path).point
    return [point[name].numpy() for name in sorted(point)]


def pymeshlab_reads(path):
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(path)
    mesh = meshes.current_mesh()
    return [mesh.vertex_matrix(), mesh.vertex_normal_matrix()]


failed = False
for name, read in [("open3d", open3d_reads), ("pymeshlab", pymeshlab_reads)]:
    augmented, base = (read(path) for path in sys.argv[1:3])
    numbers = sum(values.size for values in augmented)
    same = numbers > 0 and len(augmented) == len(base) and all(map(numpy.array_equal, augmented, base))
    failed |= not same
    print(f"{'the base' if same else 'NOT THE BASE'}  {name}: {numbers} numbers")
stage = Usd.Stage.Open(sys.argv[3])
prim = stage.GetDefaultPrim()
# The stage is y up and z back.
positions = numpy.array(prim.GetAttribute("positions").Get()) * [1, -1, -1]
same = numpy.array_equal(positions, open3d.t.io.read_point_cloud(sys.argv[2]).point.positions.numpy())
failed |= not same
print(f"{'the base' if same else 'NOT THE BASE'}  usd-core, {prim.GetTypeName()}: {positions.size} positions")
sys.exit(failed)
