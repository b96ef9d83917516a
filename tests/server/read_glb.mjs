// Opens a GLB file with three.js, as the page does, and prints what a viewer would show: node read_glb.mjs FILE
import { readFile } from "node:fs/promises";
import { Box3, Matrix4, Vector3 } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";

const file = await readFile(process.argv[2]);
const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength);
const { scene } = await new GLTFLoader().parseAsync(bytes, "");
scene.updateMatrixWorld(true);
const panels = [];
const geometries = new Set();
scene.traverse((node) => {
  if (!node.isMesh) return;
  geometries.add(node.geometry.uuid);
  const place = node.geometry.attributes.position;
  const corners = [];
  for (let i = 0; i < place.count; i++) {
    const p = new Vector3().fromBufferAttribute(place, i).applyMatrix4(node.matrixWorld);
    corners.push([p.x, p.y, p.z]);
  }
  panels.push({ name: node.name, data: node.userData, color: node.material.color.getHexString(), corners });
});
const box = new Box3().setFromObject(scene);
console.log(JSON.stringify({ panels, geometries: geometries.size, size: box.getSize(new Vector3()).toArray() }));
