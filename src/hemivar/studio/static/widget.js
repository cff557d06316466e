// The studio in a notebook: its modules come as texts, each is made a module of its own, and messages go through the
// kernel instead of a socket.

const loaded = new Map();

/** Import the last of some modules, given as texts in an order in which each stands after those that it imports. */
function modulesOf(texts) {
  let last = null;
  for (const [name, text] of Object.entries(texts)) {
    if (!loaded.has(name)) {
      const folder = name.includes("/") ? name.slice(0, name.lastIndexOf("/") + 1) : "";
      const linked = text.replace(/(from\s*|import\s*)(["'])\.\/([\w./]+)\2/g, (whole, word, quote, file) => {
        const address = loaded.get(folder + file) || loaded.get(file);
        return address ? `${word}${quote}${address}${quote}` : whole;
      });
      loaded.set(name, URL.createObjectURL(new Blob([linked], { type: "text/javascript" })));
    }
    last = loaded.get(name);
  }
  return { last, of: (name) => import(loaded.get(name)) };
}

async function render({ model, el }) {
  const modules = modulesOf(model.get("modules"));
  const { arraysOf } = await modules.of("dom.js");
  const { mount } = await modules.of("studio.js");
  const link = { send: (request) => model.send(request) };
  const place = document.createElement("div");
  place.className = "in-notebook";
  el.append(place);
  mount(place, link, { hash: false });
  const hear = (head, buffers) => link.onmessage(head, head.arrays ? arraysOf(head, buffers) : {});
  model.on("msg:custom", hear);
  link.onstate(true);
  model.send({ type: "hello" });
  return () => model.off("msg:custom", hear);
}

export default { render };
