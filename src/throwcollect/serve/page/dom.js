/** Small helpers that make and change elements without disturbing the element that has the focus. */

/**
 * Find an element of the page by its id.
 * @param {string} id
 * @returns {any} the element
 */
export function get(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no #${id}`);
  return element;
}

/**
 * Make an element.
 * @param {string} tag
 * @param {Record<string, unknown>} [properties] properties; those with a dash and `role` are attributes
 * @param {...(Node | string)} children
 * @returns {any} the element
 */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-") || name === "role") element.setAttribute(name, String(value));
    else element[name] = value;
  }
  element.append(...children);
  return element;
}

/**
 * Make a button.
 * @param {string} text
 * @param {() => void} act called when it is pressed
 * @param {Record<string, unknown>} [properties] as `make` takes them
 * @returns {any} the button
 */
export function makeButton(text, act, properties = {}) {
  const button = make("button", { type: "button", ...properties }, text);
  button.addEventListener("click", act);
  return button;
}

/**
 * Set the text of an element only if it differs, because screen readers read out each change.
 * @param {Element} element
 * @param {string} text
 */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Set the choices of a select, and keep the chosen one if it is still among them.
 * @param {HTMLSelectElement} select
 * @param {[string, string][]} choices values and texts
 */
export function setChoices(select, choices) {
  const now = JSON.stringify(choices);
  if (select.dataset.choices === now) return;
  const chosen = select.value;
  select.dataset.choices = now;
  select.replaceChildren(...choices.map(([value, text]) => make("option", { value }, text)));
  if (choices.some(([value]) => value === chosen)) select.value = chosen;
}

/**
 * Show a problem where it happened, with what would be right and a hint; without a problem, clear the place.
 * @param {Element} place
 * @param {unknown} error
 */
export function showProblem(place, error) {
  place.replaceChildren();
  if (error === null || error === undefined) return;
  const { message, facts = {} } = /** @type {any} */ (error);
  const lines = message.split("\n");
  place.append(...lines.map((line) => make("p", {}, line)));
  const problems = (facts.problems ?? []).filter((each) => each.message).map(({ key, message: text }) => (key ? `${key}: ${text}` : text));
  // The message of a wrong configuration has a line for each problem, which may begin with the name of the file.
  const others = problems.filter((each) => !lines.some((line) => line.endsWith(each)));
  if (others.length) place.append(make("ul", {}, ...others.map((each) => make("li", {}, each))));
  if (facts.expected) place.append(make("p", {}, `expected: ${facts.expected}`));
  if (facts.hint) place.append(make("p", {}, `try: ${facts.hint}`));
}
