// Clients of a server that speaks foxglove.websocket.v1, made of the protocol's own package. A test writes one command a
// line (JSON) to the standard input and reads one event a line from the standard output.
"use strict";

const path = require("path");
const readline = require("readline");
const from = (name) => require(path.join(process.env.PALPATE_NODE_MODULES, name));
const { FoxgloveClient } = from("@foxglove/ws-protocol");
const { parse } = from("@foxglove/rosmsg");
const WebSocket = from("ws");

const clients = new Map();

function say(event) {
  process.stdout.write(JSON.stringify(event) + "\n");
}

function connect(name, url, protocols) {
  const ws = new WebSocket(url, protocols ?? [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
  const client = new FoxgloveClient({ ws });
  const state = { ws, client, channels: new Map(), topics: new Map(), subscriptions: new Map() };
  clients.set(name, state);
  client.on("open", () => say({ client: name, event: "open", protocol: ws.protocol }));
  client.on("error", (error) => say({ client: name, event: "error", message: error.message }));
  client.on("close", (event) =>
    say({ client: name, event: "close", code: event.code, reason: event.reason }),
  );
  client.on("serverInfo", (info) => say({ client: name, event: "serverInfo", info }));
  client.on("status", (status) => say({ client: name, event: "status", ...status }));
  client.on("time", ({ timestamp }) =>
    say({ client: name, event: "time", time: timestamp.toString() }),
  );
  client.on("advertise", (channels) => {
    for (const channel of channels) {
      state.channels.set(channel.topic, channel.id);
      // The definitions are read as the viewers read them.
      const definitions = parse(channel.schema, { ros2: true });
      channel.types = definitions.length;
      channel.fields = definitions[0].definitions.filter((f) => !f.isConstant).map((f) => f.name);
    }
    say({ client: name, event: "advertise", channels });
  });
  client.on("unadvertise", (ids) => say({ client: name, event: "unadvertise", ids }));
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const topic = state.topics.get(subscriptionId);
    const bytes = Buffer.from(data.buffer, data.byteOffset, data.byteLength);
    const event = { client: name, event: "message", topic, time: timestamp.toString() };
    // Of a long message, the first bytes.
    event.length = bytes.length;
    event.hex = bytes.subarray(0, 20000).toString("hex");
    // The first two fields of a tick and of a model are 64-bit integers after the four bytes of the encapsulation.
    if (data.byteLength >= 20) {
      event.numbers = [data.getBigUint64(4, true), data.getBigUint64(12, true)].map(String);
    }
    say(event);
  });
}

const commands = {
  connect: ({ client, url, protocols }) => connect(client, url, protocols),
  subscribe: ({ client, topic }) => {
    const state = clients.get(client);
    const id = state.client.subscribe(state.channels.get(topic));
    state.topics.set(id, topic);
    state.subscriptions.set(topic, id);
  },
  unsubscribe: ({ client, topic }) => {
    const state = clients.get(client);
    state.client.unsubscribe(state.subscriptions.get(topic));
  },
  text: ({ client, text }) => clients.get(client).ws.send(text),
  binary: ({ client, hex }) => clients.get(client).ws.send(Buffer.from(hex, "hex")),
  // What the package offers beyond subscriptions.
  everything: ({ client }) => {
    const state = clients.get(client);
    const id = state.client.advertise({ topic: "/a", encoding: "json", schemaName: "b" });
    state.client.sendMessage(id, new Uint8Array([1, 2, 3]));
    state.client.unadvertise(id);
    state.client.getParameters([], "id");
    state.client.setParameters([{ name: "p", value: 1 }], "id");
    state.client.subscribeParameterUpdates(["p"]);
    state.client.sendServiceCallRequest({
      serviceId: 1,
      callId: 2,
      encoding: "json",
      data: new DataView(new ArrayBuffer(2)),
    });
    state.client.subscribeConnectionGraph();
    state.client.fetchAsset("package://a/b", 1);
  },
  pause: ({ client }) => clients.get(client).ws._socket.pause(),
  resume: ({ client }) => clients.get(client).ws._socket.resume(),
  close: ({ client }) => clients.get(client).client.close(),
};

readline
  .createInterface({ input: process.stdin })
  .on("line", (line) => {
    const command = JSON.parse(line);
    commands[command.do](command);
  })
  .on("close", () => process.exit(0));
