// Dark or light: as the system has it, until the switch says otherwise.

const PLACE = "hapticd-theme";

export class Theme {
  constructor(button, onChange) {
    this.system = matchMedia("(prefers-color-scheme: dark)");
    this.colours = new Map();
    this.changed = () => { this.colours.clear(); onChange(); };
    this.system.addEventListener("change", this.changed);
    button.addEventListener("click", () => this.set(this.isDark ? "light" : "dark"));
    const kept = localStorage.getItem(PLACE);
    if (kept) document.documentElement.dataset.theme = kept;
  }

  get isDark() {
    const chosen = document.documentElement.dataset.theme;
    return chosen ? chosen === "dark" : this.system.matches;
  }

  set(name) {
    document.documentElement.dataset.theme = name;
    localStorage.setItem(PLACE, name);
    this.changed();
  }

  /** A colour of colours.css by its name. */
  colour(name) {
    if (!this.colours.has(name)) {
      this.colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
    }
    return this.colours.get(name);
  }
}
