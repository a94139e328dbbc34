/** Short ways to the elements of the page. */

/**
 * Finds an element that the page has.
 * @param {string} id
 * @returns {HTMLElement}
 */
export function part(id) {
  const element = document.getElementById(id);
  if (element === null) {
    throw new Error(`index.html has no element with id ${id}`);
  }
  return element;
}

/**
 * Changes a text only if it differs: screen readers speak whatever is written.
 * @param {Element} element
 * @param {string} text
 */
export function write(element, text) {
  if (element.textContent !== text) {
    element.textContent = text;
  }
}

/**
 * Makes an element.
 * @param {string} name
 * @param {string} text
 * @param {string} [tone] good, care or danger
 * @returns {HTMLElement}
 */
export function make(name, text, tone = "") {
  const element = document.createElement(name);
  element.textContent = text;
  if (tone) {
    element.dataset.tone = tone;
  }
  return element;
}

/**
 * Acts when a button is pressed, also by a second finger while the first one steers: browsers make no click of that.
 * @param {HTMLElement} button
 * @param {() => void} act
 */
export function onPress(button, act) {
  button.addEventListener("click", act);
  button.addEventListener("pointerup", (event) => {
    const under = document.elementFromPoint(event.clientX, event.clientY);
    if (!event.isPrimary && event.pointerType === "touch" && button.contains(under) && !button.matches(":disabled")) {
      act();
    }
  });
}
