// A page that was opened from disk cannot load the bodies that turn: it says so, and the image stays.
if (location.protocol === "file:") {
  document.addEventListener("DOMContentLoaded", () => {
    for (const host of document.querySelectorAll(".figure-3d")) {
      const said = document.createElement("p");
      said.className = "figure-3d-told";
      said.textContent = "To turn this body, run python -m http.server in the folder of the site and open localhost:8000.";
      host.append(said);
    }
  });
}
