// Dialogs above everything; the browser keeps the focus inside.
import type { ComponentChildren } from "preact";
import { useId, useLayoutEffect, useRef } from "preact/hooks";
import { ToolButton } from "./button";

/** A dialog, shown as long as it is rendered. Escape and the close button call `onClose`; a `form` with buttons goes in `actions`. */
export function Dialog(props: {
  title: string;
  onClose: () => void;
  children: ComponentChildren;
  actions?: ComponentChildren;
  wide?: boolean;
  /** Where a choice must be made: no close button, Escape does nothing. */
  modal?: boolean;
  class?: string;
}) {
  const { title, onClose, children, actions, wide, modal } = props;
  const id = useId();
  const dialog = useRef<HTMLDialogElement>(null);
  // Before the next key: what is typed right after the shortcut belongs to the dialog.
  useLayoutEffect(() => {
    const element = dialog.current;
    const before = document.activeElement as HTMLElement | null;
    element?.showModal();
    const first = ["[data-autofocus]", ".dialog-body :is(input, select, button)", ".dialog-actions button"]
      .map((selector) => element?.querySelector<HTMLElement>(selector)).find((found) => found);
    (first ?? element)?.focus();
    return () => { element?.close(); before?.focus?.(); };
  }, []);
  return (
    <dialog
      ref={dialog}
      tabIndex={-1}
      class={`dialog ${wide ? "wide" : ""} ${props.class ?? ""}`}
      aria-labelledby={id}
      onCancel={(event) => { event.preventDefault(); if (!modal) onClose(); }}
      onMouseDown={(event) => { if (!modal && event.target === event.currentTarget) onClose(); }}
      onKeyDown={(event) => event.stopPropagation()}
    >
      <div class="dialog-head">
        <h2 id={id} class="grow ellipsis">{title}</h2>
        {!modal && <ToolButton icon="close" label="Close" onClick={onClose} />}
      </div>
      <div class="dialog-body">{children}</div>
      {actions && <div class="dialog-actions">{actions}</div>}
    </dialog>
  );
}
