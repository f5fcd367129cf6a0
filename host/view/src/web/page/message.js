/**
 * Decodes the binary messages of the server (host/src/live/message.rs): a kind (one byte, then three zero bytes), the
 * length of a JSON part, the JSON part, and a binary part. Arrays of numbers are views of the received bytes; nothing is
 * copied. Typed arrays use the byte order of the processor, which is little-endian on every processor that runs a
 * current browser; `LITTLE` checks this.
 */

/** The kinds of messages. */
export const Kind = Object.freeze({
  HELLO: 1, SURFACE: 2, FRAME: 3, HISTORY: 4, PLAYBACK: 5, END: 6, REFUSED: 7,
});

/** The version of the messages that this page reads. */
export const PROTOCOL = "palpate.view/1";

const LITTLE = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;
const text = new TextDecoder("utf-8", { fatal: true });

/** Takes the parts of the binary part in order. */
class Parts {
  constructor(buffer, at) {
    this.buffer = buffer;
    this.at = at;
  }

  /** The next `count` numbers of four bytes each, as a view. */
  take(Type, count) {
    const end = this.at + 4 * count;
    if (!Number.isSafeInteger(count) || end > this.buffer.byteLength) {
      throw new Error("a message is too short");
    }
    const view = new Type(this.buffer, this.at, count);
    this.at = end;
    return view;
  }
}

/**
 * Decodes a message.
 * @param {ArrayBuffer} buffer the bytes of one message
 * @returns {{kind: number, body: any}} the kind, and the JSON part with the arrays of the binary part added to it:
 *   `rest`, `triangles`, `lines` of a surface; `positions` and `stress` of the vertices of a frame
 */
export function decode(buffer) {
  if (!LITTLE) throw new Error("the processor is not little-endian");
  if (buffer.byteLength < 8) throw new Error("a message is too short");
  const head = new DataView(buffer);
  const kind = head.getUint8(0);
  const length = head.getUint32(4, true);
  if (8 + length > buffer.byteLength) throw new Error("a message is too short");
  const body = JSON.parse(text.decode(new Uint8Array(buffer, 8, length)));
  const parts = new Parts(buffer, 8 + length);
  if (kind === Kind.HELLO && body.protocol !== PROTOCOL) {
    throw new Error(`the server has the version ${body.protocol}, and this page reads ${PROTOCOL}`);
  }
  if (kind === Kind.SURFACE) {
    body.rest = parts.take(Float32Array, 3 * body.vertices);
    body.triangles = parts.take(Uint32Array, 3 * body.triangle_count);
    body.lines = parts.take(Uint32Array, 2 * body.line_count);
  }
  if (kind === Kind.FRAME) {
    for (const { vertices } of body.bodies) {
      if (!vertices) continue;
      vertices.positions = parts.take(Float32Array, 3 * vertices.count);
      vertices.stress = vertices.stressed ? parts.take(Float32Array, vertices.count) : null;
    }
  }
  if (kind <= Kind.REFUSED && parts.at !== buffer.byteLength) {
    throw new Error("a message has bytes after its end");
  }
  return { kind, body };
}
