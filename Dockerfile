# rhabdom in a container, CPU only:
#   docker build -t rhabdom . && docker run --rm -v "$PWD/runs:/evolved/runs" rhabdom run detection --preset quick
FROM python:3.12-slim-bookworm
RUN apt-get update -qq && apt-get install -y -qq --no-install-recommends libllvm19 libatomic1 && rm -rf /var/lib/apt/lists/*
RUN pip install --no-cache-dir torch --index-url https://download.pytorch.org/whl/cpu
COPY . /src
RUN pip install --no-cache-dir /src && rm -rf /src && evolve doctor
WORKDIR /evolved
ENTRYPOINT ["evolve"]
CMD ["--help"]
