"""GLB files as whittle writes them: one mesh of triangles, all of whose bytes lie in the file."""
import json
import struct

SCALARS = {5120: "b", 5121: "B", 5123: "H", 5125: "I", 5126: "f"}
LANES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def load(path):
    """The JSON; the attributes of the vertices, by name; the corners of the triangles, one by one."""
    data = open(path, "rb").read()
    n, = struct.unpack_from("<I", data, 12)
    j, body = json.loads(data[20:20 + n]), data[28 + n:]

    def read(i):
        a = j["accessors"][i]
        view = j["bufferViews"][a["bufferView"]]
        item = "<%d%s" % (LANES[a["type"]], SCALARS[a["componentType"]])
        stride = view.get("byteStride", struct.calcsize(item))
        assert stride % 4 == 0 or a["type"] == "SCALAR"
        at = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        return [struct.unpack_from(item, body, at + k * stride) for k in range(a["count"])]

    primitive = j["meshes"][0]["primitives"][0]
    return j, {name: read(i) for name, i in primitive["attributes"].items()}, [x for x, in read(primitive["indices"])]
