/** Files that the browser saves. */

import { make } from "./dom.js";

/**
 * @param {Blob} content
 * @param {string} name of the file
 */
export function saveFile(content, name) {
  const link = make("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}
