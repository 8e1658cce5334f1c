// One value of the form: its name, unit, bounds and meaning, and what is wrong with it.

const UNITS = /_(n_per_m|n_s_per_m|m_per_s|n|m|s|hz|kg|j|us)$/;

export class Field {
  /** @param spec as the server sends it: key, name, unit, meaning, allowed, kind, choices, optional, value */
  constructor(spec, isDisabled, onChange) {
    this.spec = spec;
    this.element = document.createElement("label");
    this.element.className = "field";
    this.element.dataset.key = spec.key;
    const name = text("span", "name", spec.name.replace(UNITS, "").replaceAll("_", " "));
    if (spec.unit) name.append(text("i", "", spec.unit));
    this.input = control(spec);
    this.input.disabled = isDisabled;
    this.meaning = text("span", "meaning", meaning(spec));
    this.element.append(name, this.input, this.meaning);
    this.input.addEventListener("input", () => { this.complain(""); this.#mark(); onChange(); });
    this.revert();
  }

  /** What the file would get: a number, a text, true or false, or null for a key that is not set. */
  get value() {
    const { kind, optional } = this.spec;
    if (kind === "flag") return this.input.checked;
    const typed = this.input.value.trim();
    if (typed === "" && optional) return null;
    if (kind !== "number" && kind !== "whole") return typed;
    const number = Number(typed.replace("−", "-"));
    return typed === "" || !Number.isFinite(number) ? typed : number; // the daemon's checks say what is wrong with it
  }

  get isChanged() {
    return this.value !== this.spec.value;
  }

  revert() {
    const { kind, value } = this.spec;
    if (kind === "flag") this.input.checked = value; else this.input.value = value ?? "";
    this.complain("");
    this.#mark();
  }

  /** Say what is wrong with the value; nothing when the text is empty. */
  complain(problem) {
    this.element.querySelector(".bad")?.remove();
    this.element.classList.toggle("wrong", Boolean(problem));
    this.input.setAttribute("aria-invalid", String(Boolean(problem)));
    if (problem) this.element.append(text("span", "bad", problem));
  }

  #mark() {
    this.element.classList.toggle("changed", this.isChanged);
  }
}

function control({ kind, choices, optional }) {
  if (kind === "choice") {
    const select = document.createElement("select");
    select.append(...choices.map((choice) => new Option(choice, choice)));
    return select;
  }
  const input = document.createElement("input");
  if (kind === "flag") input.type = "checkbox";
  if (kind === "number" || kind === "whole") input.inputMode = "decimal";
  if (optional) input.placeholder = "not set";
  return input;
}

function meaning({ meaning: said, allowed }) {
  const words = said.replace(/\s*\[[^\]]+\]/, "").replaceAll("`", "");
  return allowed ? `${words}; ${allowed}` : words;
}

function text(tag, kind, said) {
  const element = document.createElement(tag);
  if (kind) element.className = kind;
  element.textContent = said;
  return element;
}
