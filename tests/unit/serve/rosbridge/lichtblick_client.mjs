// What Lichtblick's connection by rosbridge does, with its own libraries; prints what came of it as JSON.
import { createRequire } from "node:module";
import { parse } from "@lichtblick/rosmsg";
import { MessageReader } from "@lichtblick/rosmsg2-serialization";

const roslib = createRequire(import.meta.url)("@foxglove/roslibjs");
const ros = new roslib.Ros({ url: process.argv[2] });
await new Promise((resolve, reject) => {
  ros.on("connection", resolve);
  ros.on("error", reject);
});
const told = {};

// Topics that nobody knows a definition of are left out; the version of ROS is told by the type of /rosout.
const { topics, types, typedefs_full_text: texts } = await new Promise((resolve, reject) => ros.getTopicsAndRawTypes(resolve, reject));
told.isRos2 = types.includes("rcl_interfaces/msg/Log");
const readers = new Map(topics.map((name, i) => [name, new MessageReader(parse(texts[i], { ros2: true }))]));
told.types = Object.fromEntries(["/words", "/states", "/rosout"].map((name) => [name, types[topics.indexOf(name)]]));

const hear = (name) => new Promise((resolve) => {
  const topic = new roslib.Topic({ ros, name, compression: "cbor-raw" });
  topic.subscribe((message) => {
    topic.unsubscribe();
    resolve(readers.get(name).readMessage(new Uint8Array(message.bytes)));
  });
});
told.words = (await hear("/words")).data;
const { name, position, velocity, header } = await hear("/states");
told.states = { name, position: [position.constructor.name, ...position], velocity: velocity.length, stamp: header.stamp };

const nodes = await new Promise((resolve, reject) => ros.getNodes(resolve, reject));
told.graph = Object.fromEntries(await Promise.all(nodes.map((node) => new Promise((resolve, reject) => {
  ros.getNodeDetails(node, (subscriptions, publications, services) => resolve([node, { subscriptions, publications, services }]), reject);
}))));

new roslib.Topic({ ros, name: "/orders", messageType: "std_msgs/msg/String", queue_size: 0 }).publish({ data: "from Lichtblick" });
const serviceType = await new Promise((resolve, reject) => ros.getServiceType("/lamp", resolve, reject));
const lamp = new roslib.Service({ ros, name: "/lamp", serviceType });
told.lamp = [serviceType, await new Promise((resolve, reject) => lamp.callService({ data: true }, resolve, reject))];

console.log(JSON.stringify(told));
ros.close();
