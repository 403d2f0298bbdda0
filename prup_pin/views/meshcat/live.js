// A served page. The explorer has sliders (`controls`), whose values go to the server, and what follows from them comes
// back. One question is on its way at a time; when its answer is there, the values of that moment are asked next. A page
// without sliders asks every second whether something else is to be seen.
const panel = document.getElementById("panel"), inputs = {};
let waiting = false, changed = false, scale = null, sent = {}, shownScale = null;

async function send(question) {
  const asking = { method: "POST", body: JSON.stringify({ ...question, known: Object.keys(commands) }) };
  try {
    const answer = await fetch("/", asking), told = await answer.json();
    receive(told);
    return told;
  } catch { return { trouble: "The program that answers has ended; start it again." }; }
}

async function poll(version) {
  const told = await send({ version });
  if (!told.trouble) setTimeout(poll, 1000, told.version ?? version);
}

function trouble(text) {
  const box = document.getElementById("trouble"); // beside sliders
  if (box) box.textContent = text || "";
}

function build(controls) {
  document.body.classList.add("live");
  panel.replaceChildren();
  element("h1", "", controls.title, panel);
  for (const group of controls.groups) {
    element("h2", "", group.title, panel);
    for (const control of group.controls) {
      const row = element("div", "control", undefined, panel);
      element("span", "name", control.label, row).title = control.label;
      const slider = element("input", "", undefined, row), number = element("input", "", undefined, row);
      element("span", "unit", control.unit, row);
      slider.type = "range"; number.type = "number";
      for (const input of [slider, number]) {
        Object.assign(input, { min: control.low, max: control.high, step: "any", value: control.value });
        input.setAttribute("aria-label", `${control.label} ${control.unit}`);
      }
      number.removeAttribute("min"); number.removeAttribute("max");
      // beside the middle of a slider numbers are rounding, and their exponents do not fit into the box
      const rounding = 1e-6 * (control.high - control.low);
      slider.addEventListener("input", () => {
        number.value = Math.abs(slider.value) < rounding ? 0 : Number(Number(slider.value).toPrecision(4));
        ask();
      });
      number.addEventListener("input", () => { if (number.value !== "") { slider.value = number.value; ask(); } });
      for (const input of [slider, number]) input.addEventListener("blur", () => { if (!waiting) settle(); });
      inputs[control.name] = { group: group.name, number, factor: control.factor, start: control.value, shown: control.value, slider };
    }
  }
  const row = element("div", "", undefined, panel);
  row.style.cssText = "display: flex; align-items: center; gap: 6px; margin: 8px 0 2px";
  if (controls.scale !== null) {
    element("span", "", "drawn ×", row);
    scale = element("input", "", undefined, row);
    Object.assign(scale, { type: "number", min: 0, step: "any", value: controls.scale });
    scale.addEventListener("blur", () => { if (!waiting) settle(); });
    scale.style.width = "5em";
    scale.setAttribute("aria-label", "deflection drawn so many times larger");
    scale.addEventListener("input", () => { if (Number(scale.value) > 0) ask(); });
    const fit = element("button", "", "fit", row);
    fit.type = "button";
    fit.addEventListener("click", () => { scale.value = ""; ask(); });
  }
  const back = element("button", "", "reset", row);
  back.type = "button";
  back.addEventListener("click", () => {
    for (const input of Object.values(inputs)) input.slider.value = input.number.value = input.start;
    ask();
  });
  element("p", "", "", panel).id = "trouble";
  element("div", "", undefined, panel).id = "matrix";
}

function ask() {
  if (waiting) { changed = true; return; }
  waiting = true; changed = false;
  const question = { pose: {}, load: {}, scale: scale && scale.value !== "" ? Number(scale.value) : null };
  sent = {};
  for (const [name, input] of Object.entries(inputs)) {
    sent[name] = Number(input.number.value);
    question[input.group][name] = sent[name] * input.factor;
  }
  send(question).then(tell);
}

function tell(told) {
  waiting = false;
  trouble(told.trouble);
  if (told.words && !panel.children.length) setTimeout(poll, 1000, told.version);
  if (told.words) {
    for (const [name, value] of Object.entries(sent)) inputs[name].shown = value;
    shownScale = told.scale;
  }
  if (told.matrix) showMatrix(told.matrix);
  if (changed) ask(); else settle();
}

// Sliders and boxes say what is shown: what was refused goes once another is used, and a slider reaches as far as its box.
function settle() {
  for (const { slider, number, shown } of Object.values(inputs)) {
    if ([slider, number].includes(document.activeElement) && Number(number.value) !== shown) continue;
    slider.min = Math.min(slider.min, shown);
    slider.max = Math.max(slider.max, shown);
    slider.value = shown;
    if (document.activeElement !== number) number.value = shown;
  }
  if (scale && shownScale && document.activeElement !== scale) scale.value = shownScale;
}

function showMatrix(matrix) {
  const box = document.getElementById("matrix");
  box.replaceChildren();
  element("h2", "", matrix.title, box);
  element("p", "note", matrix.detail, box);
  if (!matrix.cells) return;
  const table = element("table", "k", undefined, box), head = element("tr", "", undefined, element("thead", "", undefined, table));
  for (const name of ["", ...matrix.columns]) element("th", "", name, head);
  const body = element("tbody", "", undefined, table);
  matrix.cells.forEach((cells, index) => {
    const line = element("tr", "", undefined, body);
    element("th", "", matrix.rows[index], line);
    for (const cell of cells) element("td", "", cell.replace("-", "\u2212"), line);
  });
}
