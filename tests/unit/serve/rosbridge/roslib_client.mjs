// What a web page does with roslib; prints what came of it as JSON.
import { Action, Ros, Service, Topic } from "roslib";

const ros = new Ros({ url: process.argv[2] });
await new Promise((resolve, reject) => {
  ros.on("connection", resolve);
  ros.on("error", reject);
});
const told = {};

const topics = await new Promise((resolve, reject) => ros.getTopics(resolve, reject));
told.type = topics.types[topics.topics.indexOf("/words")];
told.nodes = await new Promise((resolve, reject) => ros.getNodes(resolve, reject));
told.details = await new Promise((resolve, reject) => ros.getMessageDetails("sensor_msgs/JointState", resolve, reject));

for (const compression of ["none", "cbor"]) {
  const states = new Topic({ ros, name: "/states", messageType: "sensor_msgs/JointState", compression });
  told[compression] = await new Promise((resolve) => {
    states.subscribe((message) => {
      states.unsubscribe();
      resolve([message.position.constructor.name, Array.from(message.position)]);
    });
  });
  // What was on its way when the subscription ended comes before this answer, and the next subscription would hear it.
  await new Promise((resolve, reject) => ros.getNodes(resolve, reject));
}

const lamp = new Service({ ros, name: "/lamp", serviceType: "std_srvs/SetBool" });
told.lamp = await new Promise((resolve, reject) => lamp.callService({ data: true }, resolve, reject));
const nobody = new Service({ ros, name: "/nobody", serviceType: "std_srvs/SetBool" });
told.nobody = await new Promise((resolve) => nobody.callService({}, resolve, resolve));

const clock = new Service({ ros, name: "/clock", serviceType: "std_srvs/SetBool" });
const asked = new Promise((resolve) => {
  clock.advertise((request, response) => {
    response.success = request.data;
    response.message = "from roslib";
    resolve();
    return true;
  });
});
new Topic({ ros, name: "/orders", messageType: "std_msgs/String" }).publish({ data: "what time is it" });
await asked;

const follow = new Action({ ros, name: "/follow", actionType: "control_msgs/action/FollowJointTrajectory" });
await new Promise((resolve, reject) => {
  follow.sendGoal(
    { trajectory: { joint_names: ["a"] } },
    (result) => resolve((told.result = result)),
    (feedback) => (told.feedback = feedback.joint_names),
    reject,
  );
});

const swing = new Action({ ros, name: "/swing", actionType: "control_msgs/action/FollowJointTrajectory" });
swing.advertise(
  (goal, id) => {
    swing.sendFeedback(id, { joint_names: goal.trajectory.joint_names });
    swing.setSucceeded(id, { error_string: "swung" });
  },
  () => {},
);
const itself = new Action({ ros, name: "/swing", actionType: "control_msgs/action/FollowJointTrajectory" });
told.swing = await new Promise((resolve) => {
  const send = () => itself.sendGoal({ trajectory: { joint_names: ["b"] } }, resolve, () => {}, () => setTimeout(send, 20));
  send();
});

console.log(JSON.stringify(told));
ros.close();
