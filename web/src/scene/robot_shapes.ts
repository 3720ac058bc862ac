import {
  BoxGeometry,
  BufferGeometry,
  CapsuleGeometry,
  Color,
  CylinderGeometry,
  Float32BufferAttribute,
  Mesh,
  MeshStandardMaterial,
  SphereGeometry,
  SRGBColorSpace,
} from "three";
import type { Geom } from "../protocol/wire";

const ROUND = 28; // segments of a circle

/** One shape of a robot's description. */
export function shapeOf(geom: Geom): Mesh {
  const mesh = new Mesh(geometryOf(geom), materialOf(geom.rgba));
  const [w, x, y, z] = geom.orientation;
  mesh.position.fromArray([...geom.position]);
  mesh.quaternion.set(x, y, z, w);
  return mesh;
}

function geometryOf(geom: Geom): BufferGeometry {
  const { shape, size } = geom;
  const [first, second, third] = size;
  switch (shape) {
    case "box":
      return new BoxGeometry(2 * first, 2 * second, 2 * third);
    case "sphere":
      return new SphereGeometry(first, ROUND, ROUND / 2);
    // Ours stand on z, those of the library on y.
    case "cylinder":
      return new CylinderGeometry(first, first, 2 * second, ROUND).rotateX(Math.PI / 2);
    case "capsule":
      return new CapsuleGeometry(first, 2 * second, 8, ROUND).rotateX(Math.PI / 2);
    case "mesh":
      return meshOf(geom);
  }
}

/** Each triangle has corners of its own, so that its edges are sharp. */
function meshOf({ vertices, triangles }: Geom): BufferGeometry {
  const corners = triangles.flatMap((at) => vertices.slice(3 * at, 3 * at + 3));
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(corners, 3));
  geometry.computeVertexNormals();
  return geometry;
}

function materialOf([red, green, blue, alpha]: Geom["rgba"]): MeshStandardMaterial {
  const color = new Color().setRGB(red, green, blue, SRGBColorSpace);
  return new MeshStandardMaterial({ color, roughness: 0.75, opacity: alpha, transparent: alpha < 1 });
}
