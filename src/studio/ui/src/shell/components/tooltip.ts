// Tooltips of icon buttons: the name and the shortcut of what the pointer rests on or the keyboard reaches. For sighted users only:
// the button's name is its `aria-label`.

const DELAY_MS = 450;
let bubble: HTMLElement | null = null;
let timer = 0;

function hide() {
  clearTimeout(timer);
  bubble?.remove();
  bubble = null;
}

function show(anchor: HTMLElement) {
  hide();
  if (!anchor.isConnected) return;
  bubble = document.createElement("div");
  bubble.className = "tooltip";
  bubble.setAttribute("aria-hidden", "true");
  bubble.textContent = anchor.dataset.tip ?? "";
  const shortcut = anchor.dataset.shortcut;
  if (shortcut) bubble.append(Object.assign(document.createElement("kbd"), { textContent: shortcut }));
  // In the dialog that it belongs to, else behind it.
  (anchor.closest("dialog") ?? document.body).append(bubble);
  const [at, own] = [anchor.getBoundingClientRect(), bubble.getBoundingClientRect()];
  const [left, top] = position(anchor.dataset.side ?? "bottom", at, own);
  bubble.style.left = `${Math.max(4, Math.min(innerWidth - own.width - 4, left))}px`;
  bubble.style.top = `${Math.max(4, Math.min(innerHeight - own.height - 4, top))}px`;
}

function position(side: string, at: DOMRect, own: DOMRect): [number, number] {
  const gap = 6;
  const middle = [at.left + (at.width - own.width) / 2, at.top + (at.height - own.height) / 2] as const;
  switch (side) {
    case "top": return [middle[0], at.top - own.height - gap];
    case "left": return [at.left - own.width - gap, middle[1]];
    case "right": return [at.right + gap, middle[1]];
    default: return [middle[0], at.bottom + gap];
  }
}

const anchorOf = (event: Event) => (event.target as Element | null)?.closest?.<HTMLElement>("[data-tip]") ?? null;

document.addEventListener("pointerover", (event) => {
  const anchor = anchorOf(event);
  hide();
  if (anchor && event.pointerType === "mouse") timer = window.setTimeout(() => show(anchor), DELAY_MS);
});
document.addEventListener("focusin", (event) => {
  const anchor = anchorOf(event);
  if (anchor?.matches(":focus-visible")) show(anchor);
});
for (const name of ["focusout", "pointerdown", "keydown", "scroll"]) document.addEventListener(name, hide, true);
