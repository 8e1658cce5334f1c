// One of a few, as a row of buttons: a radio group for fingers.

export class Choice {
  /**
   * @param row where the buttons go
   * @param options [value, label] pairs
   * @param value chosen at first
   * @param onChange called with the value that is pressed, also when it is the one chosen already
   */
  constructor(row, options, value, onChange) {
    this.buttons = new Map(options.map(([one, label]) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = label;
      button.setAttribute("role", "radio");
      button.addEventListener("click", () => { this.set(one); onChange(one); });
      row.append(button);
      return [one, button];
    }));
    this.set(value);
  }

  set(value) {
    this.value = value;
    for (const [one, button] of this.buttons) button.setAttribute("aria-checked", String(one === value));
  }
}
