// Readers of the web. `node node.mjs NAME FOLDER FILE...` puts what NAME reads there, as JSON.
// They are installed beside the folder in which this is run: node_modules.

import fs from "node:fs";
import path from "node:path";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const required = createRequire(path.resolve("node_modules/"));
const imported = (name) => import(pathToFileURL(path.resolve("node_modules", name)).href);
const loader = async (name) => new (await imported(`three/examples/jsm/loaders/${name}.js`))[name]();

async function three(file, bytes) {
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  if (file.endsWith("obj")) return joined((await loader("OBJLoader")).parse(bytes.toString()));
  if (file.endsWith("stl")) return joined((await loader("STLLoader")).parse(buffer));
  if (file.endsWith("glb")) {
    const model = await (await loader("GLTFLoader")).parseAsync(buffer, "");
    return { ...joined(model.scene, true), animations: model.animations.length };
  }
  const ply = await loader("PLYLoader");
  const names = ["u", "v", "gaussian_curvature", "mean_curvature", "quality"];
  ply.setCustomPropertyNameMapping(Object.fromEntries(names.map((name) => [name, [name]])));
  return joined(ply.parse(buffer));
}

/** All triangles and segments below an object, or of a geometry. */
function joined(root, downwards = false) {
  const found = { points: [], cells: [], normals: [], uv: [], names: [], attributes: {}, targets: {} };
  const add = (name, lines, geometry, targets = {}) => {
    const start = found.points.length;
    const rows = (values) => Array.from({ length: values.count }, (_, i) =>
      Array.from({ length: values.itemSize }, (_, k) => values.getComponent(i, k)));
    found.names.push(name);
    for (const [key, values] of Object.entries(geometry.attributes)) {
      if (key === "position") found.points.push(...rows(values));
      else if (key === "normal") found.normals.push(...rows(values));
      else if (key === "uv") found.uv.push(...rows(values).map(([u, v]) => [u, downwards ? 1 - v : v]));
      else if (values.count) found.attributes[key] = rows(values).flat();
    }
    for (const [target, number] of Object.entries(targets)) { // they are differences
      const moves = rows(geometry.morphAttributes.position[number]);
      found.targets[target] = moves.map((move, i) => move.map((value, k) => found.points[start + i][k] + value));
    }
    const corners = geometry.index ? Array.from(geometry.index.array) : null;
    const count = corners ? corners.length : geometry.attributes.position.count;
    const size = lines ? 2 : 3;
    for (let i = 0; i < count; i += size) {
      found.cells.push(Array.from({ length: size }, (_, k) => start + (corners ? corners[i + k] : i + k)));
    }
  };
  if (root.isBufferGeometry) {
    if (root.index || root.attributes.position.count % 3 === 0) add("", false, root);
    else found.points.push(...Array(root.attributes.position.count).fill([0, 0, 0])); // points, and nothing between them
  } else {
    root.traverse((object) => object.geometry
      && add(object.name, object.isLineSegments, object.geometry, object.morphTargetDictionary));
  }
  return found;
}

async function validator(file, bytes) {
  const report = await required("gltf-validator").validateBytes(new Uint8Array(bytes));
  const messages = report.issues.messages.filter((message) => message.code !== "UNUSED_OBJECT");
  if (messages.length) throw new Error(`${messages.length} messages, such as ${JSON.stringify(messages[0])}`);
  return { vertices: report.info.totalVertexCount, cells: report.info.totalTriangleCount || null,
    animations: report.info.animationCount };
}

const readers = { three: [three, "three"], validator: [validator, "gltf-validator"] };
const [name, folder, ...files] = process.argv.slice(2);
const [read, version] = readers[name];
for (const file of files) {
  let found;
  try {
    found = await read(file, fs.readFileSync(file));
  } catch (error) {
    found = { error: String(error) };
  }
  found.version = JSON.parse(fs.readFileSync(path.resolve("node_modules", version, "package.json"))).version;
  const target = path.join(folder, `${path.basename(file)}.json`);
  fs.writeFileSync(`${target}.part`, JSON.stringify(found));
  fs.renameSync(`${target}.part`, target);
}
