// Light or dark: as the system says until the reader says otherwise; and the machines of the header.

const KEY = "linkage-atlas-theme";
const system = matchMedia("(prefers-color-scheme: dark)");

function stored() {
  try { return localStorage.getItem(KEY); } catch { return null; }
}

function apply() {
  document.documentElement.dataset.theme = stored() ?? (system.matches ? "dark" : "light");
  document.dispatchEvent(new Event("themechange"));
}

export function startTheme() {
  apply();
  system.addEventListener("change", apply);
  document.getElementById("theme").addEventListener("click", () => {
    const next = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem(KEY, next); } catch { /* for this visit only */ }
    document.documentElement.dataset.theme = next;
    document.dispatchEvent(new Event("themechange"));
  });
}

/** Links to the machines that this service has. */
export async function startScenes(current = null) {
  const nav = document.getElementById("scenes");
  try {
    const scenes = await (await fetch("/scenes")).json();
    for (const { name, title } of scenes) {
      const link = document.createElement("a");
      link.href = `/scenes/${encodeURIComponent(name)}`;
      link.textContent = title;
      if (name === current) link.setAttribute("aria-current", "page");
      nav.append(link);
    }
  } catch { /* the four-bar works without them */ }
}
