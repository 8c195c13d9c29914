mod render;
mod render_oracle;
