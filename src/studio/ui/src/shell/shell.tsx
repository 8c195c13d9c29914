// Everything around the workspaces.
export function Shell() {
  return <div class="shell" />;
}
