/** Shortcuts of the keyboard, and the list of them. */

import { get, make } from "./dom.js";

/** @typedef {{keys: string[], text: string, act: (key: string) => void}} Shortcut */

/**
 * Make shortcuts act wherever the user is not typing, and list them.
 * @param {Shortcut[]} shortcuts for the whole page
 * @param {Shortcut[]} ofCanvas for the view while it has the focus
 */
export function listenForKeys(shortcuts, ofCanvas) {
  const list = (each) => [make("dt", {}, each.keys.map((key) => (key === " " ? "Space" : key)).join(" ")), make("dd", {}, each.text)];
  get("keys").replaceChildren(...shortcuts.flatMap(list), ...ofCanvas.flatMap((each) => {
    const [keys, text] = list(each);
    text.append(" (in the view)");
    return [keys, text];
  }));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    const { target } = event;
    if (target.matches("input, textarea, select, button, summary") && (event.key === " " || target.matches(":not(button, summary)"))) return;
    const inCanvas = target === get("canvas") ? ofCanvas : [];
    const found = [...inCanvas, ...shortcuts].find(({ keys }) => keys.includes(event.key));
    if (!found) return;
    event.preventDefault();
    found.act(event.key);
  });
}
