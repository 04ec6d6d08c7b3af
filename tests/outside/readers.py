"""Reads two PLY files with other programs, an augmented scene and its base alone: readers.py AUGMENTED BASE USD... Each program must get
the same data from both. The other files are the base in OpenUSD, which usd-core must read and find valid. Run by tools/readers, which
installs the packages."""

import sys

import numpy
import open3d
import pymeshlab
from pxr import Usd, UsdValidation


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
layout = UsdValidation.ValidationRegistry().GetOrLoadValidatorsByName(["usdUtilsValidators:UsdzPackageValidator"])
for path in sys.argv[3:]:
    stage = Usd.Stage.Open(path)
    prim = stage.GetDefaultPrim()
    # The stage is y up and z back.
    positions = numpy.array(prim.GetAttribute("positions").Get()) * [1, -1, -1]
    same = numpy.array_equal(positions, open3d.t.io.read_point_cloud(sys.argv[2]).point.positions.numpy())
    faults = [fault.GetMessage() for fault in UsdValidation.ValidationContext(layout).Validate(stage)]
    failed |= not same or len(faults) > 0
    ending = path.rpartition(".")[2]
    print(f"{'the base' if same else 'NOT THE BASE'}  usd-core, .{ending}, {prim.GetTypeName()}: {positions.size} positions", *faults)
sys.exit(failed)
