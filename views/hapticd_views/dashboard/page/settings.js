// Law, scene and limits: the daemon's own file as a form. The server checks it as the daemon does.

import { Field } from "./field.js";

const TABS = [["law", "Law"], ["scene", "Scene"], ["limits", "Limits"], ["events", "Events"]];

export class Settings {
  constructor(connection) {
    this.connection = connection;
    this.get = (id) => document.getElementById(id);
    this.form = null;
    this.fields = [];
    this.hash = "";
    this.tabs = new Map(TABS.map(([name, label]) => [name, this.#tab(name, label)]));
    this.show("law");
    this.get("form").addEventListener("submit", (event) => { event.preventDefault(); this.apply(); });
    this.get("revert").addEventListener("click", () => this.revert());
  }

  get isChanged() {
    return this.form !== null && (this.law.value !== this.form.law || this.fields.some((field) => field.isChanged));
  }

  show(name) {
    for (const [one, button] of this.tabs) {
      button.setAttribute("aria-selected", String(one === name));
      this.get(`page-${one}`).hidden = one !== name;
    }
  }

  /** Ask for the form when the file in force is another one; what is being typed is not thrown away. */
  follow(hash, mayCommand) {
    if (this.get("apply").disabled || (hash === this.hash && mayCommand === this.mayCommand)) return;
    const isShown = hash === this.form?.hash && mayCommand === this.mayCommand;
    this.hash = hash;
    this.mayCommand = mayCommand;
    if (isShown) return;
    if (this.isChanged) this.#note("The file in force has changed. Revert to see it.", true);
    else this.load();
  }

  async load() {
    const answer = await this.connection.ask({ do: "form" });
    if (!answer.ok) {
      this.form = null;
      this.#note(answer.text, true);
      return;
    }
    this.form = answer.form;
    this.#build();
  }

  revert() {
    this.load();
  }

  async apply() {
    const changed = this.fields.filter((field) => field.isChanged);
    const values = Object.fromEntries(changed.map((field) => [field.spec.key, field.value]));
    this.get("apply").disabled = true;
    this.#note("Checking …");
    const answer = await this.connection.ask({ do: "edit", hash: this.form.hash, law: this.law.value, values });
    if (answer.ok) await this.load();
    this.get("apply").disabled = false;
    if (answer.ok) {
      this.#note("In force.");
      return;
    }
    const problems = { ...(answer.problems ?? { "": answer.text }) };
    for (const field of this.fields) {
      field.complain(problems[field.spec.key] ?? "");
      if (problems[field.spec.key]) delete problems[field.spec.key];
    }
    const wrong = this.fields.find((field) => field.element.classList.contains("wrong"));
    if (wrong) {
      this.show(wrong.element.closest("[role=tabpanel]").id.replace("page-", ""));
      wrong.element.scrollIntoView({ block: "nearest" });
    }
    const others = Object.entries(problems).map(([key, problem]) => (key ? `${key}: ${problem}` : problem));
    this.#note(["Refused, nothing changed.", ...others].join(" "), true);
  }

  #tab(name, label) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = label;
    button.setAttribute("role", "tab");
    button.addEventListener("click", () => this.show(name));
    this.get("tabs").append(button);
    return button;
  }

  #build() {
    const { laws, law, scene, limits } = this.form;
    this.law = document.createElement("select");
    this.law.append(...laws.map(({ name }) => new Option(name, name)));
    this.law.value = law;
    this.law.disabled = !this.mayCommand;
    this.law.addEventListener("change", () => { this.#buildLaw(); this.#changed(); });
    this.sceneFields = scene.flatMap(({ fields }) => fields.map((spec) => this.#field(spec)));
    this.limitFields = limits.map((spec) => this.#field(spec));
    let next = 0;
    this.get("page-scene").replaceChildren(...scene.flatMap(({ title, fields }) => [
      heading(title), ...fields.map(() => this.sceneFields[next++].element)]));
    if (!scene.length) this.get("page-scene").append(heading("Nothing is there: free space"));
    this.get("page-limits").replaceChildren(...this.limitFields.map(({ element }) => element));
    this.#buildLaw();
    this.#changed();
    this.#note(this.mayCommand ? this.#file() : "Read only: open the address with the token to edit.");
  }

  #buildLaw() {
    const { summary, fields } = this.form.laws.find(({ name }) => name === this.law.value);
    this.lawFields = fields.map((spec) => this.#field(spec));
    this.fields = [...this.lawFields, ...this.sceneFields, ...this.limitFields];
    const row = document.createElement("label"), name = document.createElement("span"), said = document.createElement("span");
    row.className = "field";
    row.dataset.key = "controller.law";
    name.className = "name";
    name.textContent = "law";
    said.className = "meaning";
    said.textContent = summary;
    row.append(name, this.law, said);
    this.get("page-law").replaceChildren(row, ...this.lawFields.map(({ element }) => element));
  }

  #field(spec) {
    return new Field(spec, !this.mayCommand, () => this.#changed());
  }

  #changed() {
    const count = this.fields.filter((field) => field.isChanged).length + Number(this.law.value !== this.form.law);
    this.get("apply").hidden = this.get("revert").hidden = count === 0;
    this.get("apply").textContent = count === 1 ? "Apply 1 change" : `Apply ${count} changes`;
    this.#note(this.#file());
  }

  #file() {
    return this.form.file.split("/").at(-1);
  }

  #note(said, isBad = false) {
    this.get("form-note").textContent = said;
    this.get("form-note").className = isBad ? "bad" : "";
  }
}

function heading(said) {
  const element = document.createElement("h3");
  element.textContent = said;
  return element;
}
