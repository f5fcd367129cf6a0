// Decodes the messages in a folder with the decoder of the page, and compares them with what the program encoded.
const assert = require("assert");
const fs = require("fs");
const path = require("path");

(async () => {
  const folder = process.argv[2];
  const { decode, Kind } = await import(path.join(folder, "message.mjs"));
  const expected = JSON.parse(fs.readFileSync(path.join(folder, "expected.json")));
  const read = (index) => {
    const file = fs.readFileSync(path.join(folder, `${index}.bin`));
    return file.buffer.slice(file.byteOffset, file.byteOffset + file.length);
  };
  const bits = (view) => [...new Uint32Array(view.buffer, view.byteOffset, view.length)];
  assert(expected.length >= 5);
  expected.forEach((message, index) => {
    const buffer = read(index);
    const { kind, body } = decode(buffer);
    assert.strictEqual(kind, message.kind);
    const arrays = [];
    if (kind === Kind.SURFACE) {
      arrays.push(body.rest, body.triangles, body.lines);
      for (const name of ["rest", "triangles", "lines"]) delete body[name];
    }
    if (kind === Kind.FRAME) {
      for (const { vertices } of body.bodies) {
        arrays.push(vertices.positions, vertices.stress);
        delete vertices.positions;
        delete vertices.stress;
      }
    }
    if (kind === Kind.HELLO) delete body.file_lengths;
    for (const view of arrays) assert.strictEqual(view.buffer, buffer, "the arrays are views of the message");
    assert.deepStrictEqual(arrays.map(bits), message.arrays);
    assert.deepStrictEqual(body, message.json);
    // A message that is cut off, or too long, is refused.
    for (const length of [0, 7, buffer.byteLength - 1, buffer.byteLength - 4]) {
      assert.throws(() => decode(buffer.slice(0, length)), `${length} bytes`);
    }
    const longer = new Uint8Array(buffer.byteLength + 4);
    longer.set(new Uint8Array(buffer));
    assert.throws(() => decode(longer.buffer));
  });
})();
