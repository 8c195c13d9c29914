// Light or dark, as the user chose or as the system says.
import { computed, effect, signal } from "@preact/signals";
import { remembered } from "./remembered";

export type ThemeChoice = "system" | "light" | "dark";

/** What the user chose. */
export const themeChoice = remembered<ThemeChoice>("theme", "system");

const query = matchMedia("(prefers-color-scheme: dark)");
const systemDark = signal(query.matches);
query.addEventListener("change", () => (systemDark.value = query.matches));

/** The theme that is shown. Views that draw by themselves repaint when it changes. */
export const theme = computed<"light" | "dark">(() =>
  themeChoice.value === "system" ? (systemDark.value ? "dark" : "light") : themeChoice.value === "dark" ? "dark" : "light");

effect(() => {
  document.documentElement.dataset.theme = theme.value;
});

/** The value of a color of style.css, such as `cssColor("--accent")`, in the current theme. */
export function cssColor(variable: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(variable).trim();
}
