// The elements of Web Awesome that the studio uses, for TSX.
import type { HTMLAttributes } from "preact";

type Element<Own> = HTMLAttributes<HTMLElement> & { [K in keyof Own]?: Own[K] } & { slot?: string };

declare module "preact" {
  namespace JSX {
    interface IntrinsicElements {
      "wa-split-panel": Element<{
        orientation: "horizontal" | "vertical";
        "position-in-pixels": number;
        primary: "start" | "end";
        disabled: boolean;
        "onwa-reposition": (event: Event) => void;
      }>;
    }
  }
}
