// Texts over the view at points of it: angles of limits, names of methods.
import { useEffect, useRef } from "preact/hooks";
import type { Scene } from "./scene";

export function Labels({ scene }: { scene: Scene }) {
  const box = useRef<HTMLDivElement>(null);
  const labels = scene.labels.value;
  useEffect(() => {
    const place = () => labels.forEach(({ at, kind }, i) => {
      const element = box.current?.children[i] as HTMLElement | undefined;
      const p = scene.view.project(at);
      if (!element) return;
      element.hidden = p === null;
      if (p) element.style.transform = `translate(${Math.round(p.x)}px, ${Math.round(p.y)}px) translate(${kind === "compare" ? "-50%, 8px" : "6px, -50%"})`;
    });
    place();
    return scene.view.onFrame(place);
  }, [labels, scene]);
  return (
    <div ref={box}>
      {labels.map(({ text, note, kind }, i) => <span key={i} class={`view-label ${kind}`}>{text}{note && <small>{note}</small>}</span>)}
    </div>
  );
}
