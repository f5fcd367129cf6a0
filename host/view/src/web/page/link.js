/**
 * The connection to the server.
 *
 * Modules register for the kinds of messages that they show with `on`, and everything that the page sends goes through
 * `send`. The display of a study registers for its own kind and sends its answers in the same way.
 */
import { decode, Kind } from "./message.js";

/** Shortest and longest wait before the page connects again (ms). */
const SHORTEST = 250;
const LONGEST = 5000;

const handlers = new Map();
let socket = null;
let wait = SHORTEST;
let timer = 0;
let begun = false;

/** Facts of the connection: `state` is `connecting`, `open`, `lost`, `refused` or `ended`. */
export const link = {
  state: "connecting", why: "", retries: 0, frames: 0, bytes: 0, arrived: 0, errors: 0, retryAt: 0, opened: 0,
};

/**
 * Registers a handler for a kind of message, or for `"line"`, a line of text from the server, or `"state"`, a change of
 * the connection.
 */
export function on(kind, handler) {
  if (!handlers.has(kind)) handlers.set(kind, []);
  handlers.get(kind).push(handler);
}

function tell(kind, body) {
  for (const handler of handlers.get(kind) ?? []) handler(body);
}

/** Sends a command, such as `{do: "seek", time_ns: 1500000000}`. Returns whether the page is connected. */
export function send(command) {
  const open = socket !== null && socket.readyState === WebSocket.OPEN;
  if (open) socket.send(JSON.stringify(command));
  return open;
}

/** Confirms that a frame was drawn, so that the server sends the next frame. */
export function drawn() {
  send({ do: "drawn" });
}

function become(state, why = "") {
  link.state = state;
  link.why = why;
  tell("state", link);
}

function take(event) {
  if (typeof event.data === "string") {
    tell("line", event.data);
    return;
  }
  let message;
  try {
    message = decode(event.data);
  } catch (error) {
    link.errors += 1;
    tell("line", `A message cannot be read: ${error.message}.`);
    return;
  }
  link.bytes += event.data.byteLength;
  link.arrived = performance.now();
  if (message.kind === Kind.HELLO) {
    wait = SHORTEST;
    become("open");
  }
  if (message.kind === Kind.FRAME) link.frames += 1;
  if (message.kind === Kind.END) become("ended", message.body);
  if (message.kind === Kind.REFUSED) become("refused", message.body);
  tell(message.kind, message.body);
}

/** Connects, and connects again whenever the connection ends. */
export function connect() {
  clearTimeout(timer);
  const address = new URL("socket", location.href);
  address.protocol = "ws:";
  socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => { link.opened += 1; };
  socket.onmessage = take;
  socket.onclose = ({ code, reason }) => {
    socket = null;
    // The server has as many viewers as it serves.
    if (code === 1013) {
      become("refused", reason);
      tell(Kind.REFUSED, reason);
    }
    if (link.state !== "refused") become("lost");
    link.retries += 1;
    link.retryAt = performance.now() + wait;
    timer = setTimeout(connect, wait);
    wait = Math.min(2 * wait, LONGEST);
  };
  if (!begun) {
    begun = true;
    addEventListener("online", () => { if (!socket) connect(); });
  }
}
