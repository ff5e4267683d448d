/** Plots that a robot's description binds to links, as `<tooltip name topic field><parent link/></tooltip>`. */

const JOINT = /^(position|velocity|effort)\[([^\]]+)\]$/;
const BALL = /^pose\.pose\.position\.([xyz])$/;

/**
 * Read the plots of a description.
 * @param {string} urdf
 * @returns {{field: "position" | "velocity" | "effort" | "ball", name: string, link: string}[]} those that can be plotted
 */
export function readTooltips(urdf) {
  const tooltips = [...new DOMParser().parseFromString(urdf, "application/xml").getElementsByTagName("tooltip")];
  return tooltips.map(readTooltip).filter((each) => each !== null);
}

function readTooltip(element) {
  const link = element.getElementsByTagName("parent")[0]?.getAttribute("link");
  const topic = element.getAttribute("topic") ?? "";
  const field = element.getAttribute("field") ?? "";
  const joint = JOINT.exec(field);
  const ball = BALL.exec(field);
  if (!link) return null;
  if (joint && topic.endsWith("joint_states")) return { field: joint[1], name: joint[2], link };
  if (ball && topic.endsWith("ball/odometry")) return { field: "ball", name: ball[1], link };
  return null;
}
